//! The grid lights that can reach a tile of receivers.

use super::contribution;
use super::interleave;
use super::record::{GridLight, Level, LightingGrid};
use super::walk::TileList;
use crate::settings::Settings;
use crate::surface::SurfacePoint;
use glam::Vec3;
use std::cmp::Reverse;

/// A grid light as the inner loop reads it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TileLight {
    pub position: [f32; 3],
    /// Mean of the unit normals, not unit itself.
    pub normal: [f32; 3],
    /// Four times the per-axis variance of the position, m².
    pub variance_4: [f32; 3],
    /// Squared distance below which the light counts as this far, m².
    pub nearest_sq: f32,
    /// What the spread adds to the squared distance, m².
    pub far: f32,
    /// What the spread takes from the squared distance that blending sees, m².
    pub nearer: f32,
    /// Three times the variance of the normals across a direction.
    pub normal_spread_3: f32,
    /// How far behind its mean plane the light may still shine, see
    /// [`contribution::reach_behind`]; for culling alone, as the next.
    pub reach_behind: [f32; 2],
    /// How far below a receiver's horizon its mean may lie, squared, m².
    pub reach_below: f32,
    pub intensity: [f32; 3],
    /// Weight per unit of geometry for the shadow draw; 0 keeps it out.
    pub shadow_weight: f32,
    /// Blending: min(clamp(d·a + b), clamp(d·c + e)).
    pub rise: [f32; 2],
    pub fall: [f32; 2],
    /// Level, 0 for a virtual light itself, and index in it.
    pub level: u32,
    pub index: u32,
    /// Which receivers see it; see [`interleave`].
    pub class: u32,
}

/// Distances that bound one level's shell, and its blending.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shell {
    pub level: u32,
    inner: f32,
    outer: f32,
    rise: [f32; 2],
    fall: [f32; 2],
}

#[cfg(test)]
impl Shell {
    /// A light of this level without spread.
    pub(super) fn point(&self) -> TileLight {
        TileLight { rise: self.rise, fall: self.fall, ..TileLight::default() }
    }
}

/// What a spread takes from the squared distance that blending sees, as a share of the variance.
///
/// Blending by the distances of mean positions gives a virtual light the trilinear mean of the
/// weights around it, ½ σ² ∇²b more than its own. σ doubles from level to level, so that all levels
/// together give too much where one rises and another falls. Along a surface, two of three axes
/// vary, ∇²b is b′/d between the bends, and half the variance makes up for that; fitted with the
/// rest of the spread, see [`contribution`].
pub(super) const NEARER: f32 = 0.3;
/// Most variance of a grid light over three axes, in squared cells.
pub(super) const MOST_VARIANCE: f32 = 3.0;

/// Blending of all levels: rises r/2 … r above the start level, falls r … 2r below the top.
///
/// Source: [LinYuksel19, Fig. 2]; level 0 takes r_0 = r_1/2.
pub(super) fn shells(grid: &LightingGrid, alpha: f32) -> Vec<Shell> {
    const ALWAYS: [f32; 2] = [0.0, 1.0];
    let top = grid.levels.len() as u32;
    let radius = |level: u32| match level {
        0 => alpha * grid.levels[0].cell_size * 0.5,
        _ => alpha * grid.levels[level as usize - 1].cell_size,
    };
    let start = if grid.level0.lights.is_empty() { 1 } else { 0 };
    let shell = |level: u32| {
        let r = radius(level);
        let (is_start, is_top) = (level == start, level == top);
        Shell {
            level,
            inner: if is_start { 0.0 } else { r * 0.5 },
            outer: if is_top { f32::INFINITY } else { 2.0 * r },
            rise: if is_start { ALWAYS } else { [2.0 / r, -1.0] },
            fall: if is_top { ALWAYS } else { [-1.0 / r, 2.0] },
        }
    };
    (start..=top).map(shell).collect()
}

/// The level a shell belongs to.
pub(super) fn level_of(grid: &LightingGrid, level: u32) -> &Level {
    if level == 0 { &grid.level0 } else { &grid.levels[level as usize - 1] }
}

impl TileLight {
    /// Share of the light that this level gives at an offset from the receiver.
    #[inline(always)]
    pub(super) fn blend<const FUSED: bool>(&self, offset: [f32; 3]) -> f32 {
        let dist_sq = contribution::dot::<FUSED>(offset, offset) - self.nearer;
        let dist = (if dist_sq > 0.0 { dist_sq } else { 0.0 }).sqrt();
        let rise = contribution::mul_add::<FUSED>(dist, self.rise[0], self.rise[1]);
        let fall = contribution::mul_add::<FUSED>(dist, self.fall[0], self.fall[1]);
        let least = if rise < fall { rise } else { fall };
        let least = if least < 1.0 { least } else { 1.0 };
        if least > 0.0 { least } else { 0.0 }
    }

    fn new(light: &GridLight, index: u32, shell: &Shell, settings: &Settings) -> Self {
        let (normal, variance) = match settings.grid.spread {
            true => (light.normal, light.variance),
            false => (light.normal.normalize_or_zero(), Vec3::ZERO),
        };
        let total_variance = variance.element_sum();
        // A unit normal's length is one within rounding, and must not pass for a spread.
        let is_point = shell.level == 0 || !settings.grid.spread;
        let normal_spread = if is_point { 0.0 } else { contribution::normal_spread(normal) };
        let is_drawn = shell.level >= settings.shadow.start_level || shell.outer.is_infinite();
        let scale = interleave::scale(shell.level, settings.interleave);
        Self {
            position: light.position.to_array(),
            normal: normal.to_array(),
            variance_4: (4.0 * variance).to_array(),
            nearest_sq: contribution::nearest_sq(total_variance),
            far: contribution::far(total_variance),
            nearer: NEARER * total_variance,
            normal_spread_3: 3.0 * normal_spread,
            reach_behind: contribution::reach_behind(normal, normal_spread, variance),
            reach_below: contribution::reach_below(variance),
            intensity: (scale * light.intensity).to_array(),
            shadow_weight: if is_drawn { scale * light.luminance } else { 0.0 },
            rise: shell.rise,
            fall: shell.fall,
            level: shell.level,
            index,
            class: interleave::class_of(light, shell.level, settings.interleave),
        }
    }
}

/// Bounds of some receivers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    position: [Vec3; 2],
    normal: [Vec3; 2],
}

impl Bounds {
    /// Bounds of receivers; none if there are none.
    pub(super) fn of<'a>(surfaces: impl Iterator<Item = &'a SurfacePoint>) -> Option<Self> {
        surfaces.fold(None, |bounds, surface| {
            let (p, n) = (surface.position, surface.ns);
            let Self { position: [p0, p1], normal: [n0, n1] } =
                bounds.unwrap_or(Self { position: [p; 2], normal: [n; 2] });
            Some(Self { position: [p0.min(p), p1.max(p)], normal: [n0.min(n), n1.max(n)] })
        })
    }
}

/// Replaces `list` by every light that can give something to a receiver inside the bounds, in the
/// order of [`place`].
pub(super) fn collect(
    grid: &LightingGrid,
    shells: &[Shell],
    settings: &Settings,
    bounds: &Bounds,
    list: &mut Vec<TileLight>,
) {
    list.clear();
    for shell in shells {
        let level = level_of(grid, shell.level);
        let mut visit = |index: u32, light: &GridLight| {
            let light = TileLight::new(light, index, shell, settings);
            if is_in_reach(&light, shell, bounds) {
                list.push(light);
            }
        };
        if shell.outer.is_infinite() {
            level.lights.iter().enumerate().for_each(|(i, l)| visit(i as u32, l));
            continue;
        }
        // A light lies within one cell of its vertex.
        let to_lattice = |p: Vec3| (p - grid.origin) / level.cell_size;
        let outer = shell.outer / level.cell_size;
        let reach = (outer * outer + NEARER * MOST_VARIANCE).sqrt() + 1.0;
        let low = (to_lattice(bounds.position[0]) - reach).floor().as_ivec3();
        let high = (to_lattice(bounds.position[1]) + reach).ceil().as_ivec3();
        level.for_each_in(low.to_array(), high.to_array(), visit);
    }
    list.sort_by_cached_key(|light| place(grid, light));
}

/// Where a light stands in a list, whatever way it was found: coarse levels first; in a level by
/// the first cell around the vertex that has a share, then by corner of that cell.
fn place(grid: &LightingGrid, light: &TileLight) -> (Reverse<u32>, u64) {
    let in_level = match light.level {
        0 => u64::from(grid.level0_lights[light.index as usize]),
        level => grid.levels[level as usize - 1].octants[light.index as usize].first_corner(),
    };
    (Reverse(light.level), in_level)
}

/// Replaces `list` by those of the lights in `wider` that a class of receivers sees and that can
/// reach inside narrower bounds.
pub(super) fn narrow(
    wider: &[TileLight],
    class: u32,
    shells: &[Shell],
    bounds: &Bounds,
    list: &mut TileList,
) {
    list.clear();
    let first = shells[0].level;
    let shell = |light: &TileLight| &shells[(light.level - first) as usize];
    let is_of_class = |l: &TileLight| l.class == class || l.class == interleave::EVERY;
    let is_wanted = |l: &&TileLight| is_of_class(l) && is_in_reach(l, shell(l), bounds);
    wider.iter().filter(is_wanted).for_each(|l| list.push(l));
}

/// Whether the shell around a light meets the bounds, any of them lies on its lit side, and it on
/// the side that any of them faces.
fn is_in_reach(light: &TileLight, shell: &Shell, bounds: &Bounds) -> bool {
    let center = Vec3::from(light.position);
    let [low, high] = bounds.position.map(|p| p - center);
    let nearest = Vec3::ZERO.clamp(low, high);
    let farthest_sq = low.abs().max(high.abs()).length_squared();
    let is_beyond = nearest.length_squared() >= shell.outer * shell.outer + light.nearer;
    // The first level gives at any distance, zero included.
    let is_inside = shell.inner > 0.0 && farthest_sq <= shell.inner * shell.inner + light.nearer;
    if is_beyond || is_inside {
        return false;
    }
    // Largest m·(x − p) over the box, against how far the spread reaches behind.
    let normal = Vec3::from(light.normal);
    let front = (normal * low).max(normal * high).element_sum();
    let [constant, slope] = light.reach_behind;
    if front <= 0.0 && front * front >= constant + slope * farthest_sq {
        return false;
    }
    // The same for n·(p − x), n anywhere in the bounds of the normals.
    let [n0, n1] = bounds.normal;
    let facing = (n0 * -low).max(n0 * -high).max((n1 * -low).max(n1 * -high)).element_sum();
    facing > 0.0 || facing * facing < light.reach_below
}

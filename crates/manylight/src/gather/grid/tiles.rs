//! The grid lights that can reach a tile of receivers.

use super::record::{GridLight, Level, LightingGrid};
use crate::settings::{GridSettings, ShadowSettings};
use glam::Vec3;

/// A grid light as the inner loop reads it.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileLight {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub intensity: [f32; 3],
    /// Weight per unit of geometry for the shadow draw; 0 keeps it out.
    pub shadow_weight: f32,
    /// Blending: min(clamp(d·a + b), clamp(d·c + e)).
    pub rise: [f32; 2],
    pub fall: [f32; 2],
    /// Level, 0 for a virtual light itself, and index in it.
    pub level: u32,
    pub index: u32,
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
    /// Blending at a distance, as the inner loop computes it.
    pub(super) fn blend(&self, d: f32) -> f32 {
        let line = |[a, b]: [f32; 2]| (d * a + b).clamp(0.0, 1.0);
        line(self.rise).min(line(self.fall))
    }
}

/// Blending of all levels: rises r/2 … r above the start level, falls r … 2r below the top.
///
/// Source: [LinYuksel19, Fig. 2]; level 0 takes r_0 = r_1/2.
pub(super) fn shells(grid: &LightingGrid, settings: &GridSettings) -> Vec<Shell> {
    const ALWAYS: [f32; 2] = [0.0, 1.0];
    let top = grid.levels.len() as u32;
    let radius = |level: u32| match level {
        0 => settings.alpha * grid.levels[0].cell_size * 0.5,
        _ => settings.alpha * grid.levels[level as usize - 1].cell_size,
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

/// Bounds of the receivers of a tile.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileBounds {
    pub low: Vec3,
    pub high: Vec3,
}

/// Appends every light that can give something to a receiver inside the bounds.
pub(super) fn collect(
    grid: &LightingGrid,
    shells: &[Shell],
    shadow: &ShadowSettings,
    bounds: &TileBounds,
    list: &mut Vec<TileLight>,
) {
    list.clear();
    for shell in shells {
        let level = level_of(grid, shell.level);
        let mut visit = |index: u32, light: &GridLight| {
            if is_in_reach(light, shell, bounds) {
                list.push(TileLight {
                    position: light.position.to_array(),
                    normal: light.normal.normalize_or_zero().to_array(),
                    intensity: light.intensity.to_array(),
                    shadow_weight: if shell.level >= shadow.start_level {
                        light.luminance
                    } else {
                        0.0
                    },
                    rise: shell.rise,
                    fall: shell.fall,
                    level: shell.level,
                    index,
                });
            }
        };
        if shell.outer.is_infinite() {
            level.lights.iter().enumerate().for_each(|(i, l)| visit(i as u32, l));
            continue;
        }
        // A light lies within one cell of its vertex.
        let to_lattice = |p: Vec3| (p - grid.origin) / level.cell_size;
        let reach = shell.outer / level.cell_size + 1.0;
        let low = (to_lattice(bounds.low) - reach).floor().as_ivec3();
        let high = (to_lattice(bounds.high) + reach).ceil().as_ivec3();
        level.for_each_in(low.to_array(), high.to_array(), visit);
    }
}

/// Whether the shell around a light meets the bounds, and any of them lies on its lit side.
fn is_in_reach(light: &GridLight, shell: &Shell, bounds: &TileBounds) -> bool {
    let nearest = light.position.clamp(bounds.low, bounds.high);
    let dist_sq = (nearest - light.position).length_squared();
    let farthest = (light.position - bounds.low).abs().max((bounds.high - light.position).abs());
    if dist_sq >= shell.outer * shell.outer
        || farthest.length_squared() <= shell.inner * shell.inner
    {
        return false;
    }
    // Largest n·(x − p) over the box.
    let low = light.normal * (bounds.low - light.position);
    let high = light.normal * (bounds.high - light.position);
    low.max(high).element_sum() > 0.0
}

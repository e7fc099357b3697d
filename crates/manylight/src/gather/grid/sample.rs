//! Gathering: each tile walks its light list once, with sums and shadow reservoirs in registers.
//!
//! Reservoirs draw a light with probability proportional to its contribution in one pass, by
//! jumping: after a light was taken at running weight W, the next one is taken where the running
//! weight passes W/u for a uniform u, which is the law of weighted reservoir sampling
//! ([LinYuksel19, App. A], `[Chao82]`) with a random number per replacement instead of per light.

use super::record::LightingGrid;
use super::tiles::{Shell, TileBounds, TileLight, collect, level_of, shells};
use crate::gather::Gathered;
use crate::math::{hash_u32, unit_f32};
use crate::settings::{Settings, ShadowEstimate, ShadowTarget};
use crate::shadow;
use crate::surface::{Receivers, SurfacePoint};
use crate::vlight::vpl;
use crate::world::World;
use glam::Vec3;
use rayon::prelude::*;

/// Receivers per side of a tile.
pub const TILE: usize = 8;
/// Receivers that the inner loop works on at once: one row of a tile.
const LANES: usize = TILE;

type Lanes = [f32; LANES];

/// Irradiance of all receivers from the lights of a grid.
///
/// Shapes: receivers `[h·w]`; out `[h·w]`
/// Cost:   lights near a tile × receivers, and `shadow.rays` rays per receiver
/// Errors: never; a grid without lights gives black
pub fn gather(
    world: &World,
    receivers: &Receivers,
    grid: &LightingGrid,
    settings: &Settings,
    d_min: f32,
    seed: u32,
) -> Gathered {
    let mut out = Gathered::dark(receivers.samples.len());
    if grid.levels.is_empty() {
        return out;
    }
    let shells = shells(grid, &settings.grid);
    let job = Job { world, receivers, grid, settings, d_min, seed, shells: &shells };
    let (tiles_x, tiles_y) = (receivers.width.div_ceil(TILE), receivers.height.div_ceil(TILE));
    let tiles: Vec<Vec<(usize, PixelResult)>> = (0..tiles_x * tiles_y)
        .into_par_iter()
        .map_init(Vec::new, |list, tile| job.gather_tile(tile % tiles_x, tile / tiles_x, list))
        .collect();
    for (index, result) in tiles.into_iter().flatten() {
        out.unshadowed[index] = result.unshadowed;
        out.shadow_ratio[index] = result.shadow_ratio;
        out.evals[index] = result.evals;
    }
    out
}

struct Job<'a> {
    world: &'a World,
    receivers: &'a Receivers,
    grid: &'a LightingGrid,
    settings: &'a Settings,
    d_min: f32,
    seed: u32,
    shells: &'a [Shell],
}

struct PixelResult {
    unshadowed: Vec3,
    shadow_ratio: f32,
    evals: u32,
}

/// One row of receivers with its running sums.
struct Row {
    position: [Lanes; 3],
    normal: [Lanes; 3],
    sum: [Lanes; 3],
    evals: Lanes,
    /// Running shadow weight.
    weight: Lanes,
    /// Smallest weight at which some reservoir changes.
    next: Lanes,
    reservoirs: Vec<Reservoir>,
}

/// The k-th reservoir of each receiver of a row.
#[derive(Clone, Copy)]
struct Reservoir {
    /// Running weight at which the next light is taken.
    next: Lanes,
    /// Position in the tile's list of the light held.
    held: [u32; LANES],
}

const NOTHING_HELD: u32 = u32::MAX;

impl Job<'_> {
    fn gather_tile(
        &self,
        tile_x: usize,
        tile_y: usize,
        list: &mut Vec<TileLight>,
    ) -> Vec<(usize, PixelResult)> {
        let (width, height) = (self.receivers.width, self.receivers.height);
        let mut results = Vec::new();
        let rows = tile_y * TILE..((tile_y + 1) * TILE).min(height);
        let columns = tile_x * TILE..((tile_x + 1) * TILE).min(width);
        let mut bounds = TileBounds { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
        for y in rows.clone() {
            let row = &self.receivers.samples[y * width..][columns.clone()];
            for surface in row.iter().filter_map(|s| s.surface) {
                bounds.low = bounds.low.min(surface.position);
                bounds.high = bounds.high.max(surface.position);
            }
        }
        if !bounds.low.is_finite() {
            return results;
        }
        collect(self.grid, self.shells, &self.settings.shadow, &bounds, list);
        for y in rows {
            let mut row = self.start_row(y * width + columns.start, columns.len());
            let first = (y * width + columns.start) as u32;
            walk(&mut row, list, self.d_min * self.d_min, hash_u32(self.seed ^ hash_u32(first)));
            for lane in 0..columns.len() {
                let index = y * width + columns.start + lane;
                let Some(surface) = &self.receivers.samples[index].surface else { continue };
                let shadow_ratio = self.shadow_ratio(index, surface, &row, lane, list);
                let unshadowed = Vec3::new(row.sum[0][lane], row.sum[1][lane], row.sum[2][lane]);
                let evals = row.evals[lane] as u32;
                results.push((index, PixelResult { unshadowed, shadow_ratio, evals }));
            }
        }
        results
    }

    fn start_row(&self, first: usize, count: usize) -> Row {
        let empty = Reservoir { next: [0.0; LANES], held: [NOTHING_HELD; LANES] };
        let mut row = Row {
            position: [[0.0; LANES]; 3],
            normal: [[0.0; LANES]; 3],
            sum: [[0.0; LANES]; 3],
            evals: [0.0; LANES],
            weight: [0.0; LANES],
            next: [0.0; LANES],
            reservoirs: vec![empty; self.settings.shadow.rays as usize],
        };
        for (lane, sample) in self.receivers.samples[first..first + count].iter().enumerate() {
            // Lanes without surface keep a zero normal and gather nothing.
            let Some(surface) = &sample.surface else { continue };
            for axis in 0..3 {
                row.position[axis][lane] = surface.position[axis];
                row.normal[axis][lane] = surface.ns[axis];
            }
        }
        row
    }

    /// Traces the drawn shadow rays of one receiver.
    fn shadow_ratio(
        &self,
        index: usize,
        surface: &SurfacePoint,
        row: &Row,
        lane: usize,
        list: &[TileLight],
    ) -> f32 {
        let shadow = &self.settings.shadow;
        let (mut seen, mut drawn, mut rays) = (0.0f32, 0.0f32, 0u32);
        for (j, reservoir) in row.reservoirs.iter().enumerate() {
            let Some(light) = list.get(reservoir.held[lane] as usize) else { continue };
            let key = hash_u32(self.seed ^ 0x5bd1_e995 ^ hash_u32(index as u32 ^ (j as u32) << 24));
            rays += 1;
            let (weight, open) = match shadow.target {
                ShadowTarget::Vpl => self.ray_to_vpl(surface, light, key),
                ShadowTarget::Variance => (1.0, self.ray_to_cloud(surface, light, key)),
            };
            let weight = if shadow.estimate == ShadowEstimate::Mean { 1.0 } else { weight };
            drawn += weight;
            seen += if open { weight } else { 0.0 };
        }
        match shadow.estimate {
            _ if rays == 0 => 1.0,
            ShadowEstimate::Unbiased => seen / rays as f32,
            _ if drawn > 0.0 => seen / drawn,
            _ => 0.0,
        }
    }

    /// Draws a real virtual light of a grid light; its contribution over its probability,
    /// relative to the running weight, and whether it is seen.
    fn ray_to_vpl(&self, surface: &SurfacePoint, light: &TileLight, key: u32) -> (f32, bool) {
        let drawn = match light.level {
            0 => self.grid.level0_lights[light.index as usize] as usize,
            level => {
                let record = &level_of(self.grid, level).lights[light.index as usize];
                self.grid.draw(level as usize, record, unit_f32(key))
            }
        };
        let vpl = &self.grid.lights[drawn];
        let d_min_sq = self.d_min * self.d_min;
        let (p, n) = (surface.position, surface.ns);
        let own = vpl::geometry(vpl.position, vpl.normal, p, n, d_min_sq);
        let mean = vpl::geometry(light.position.into(), light.normal.into(), p, n, d_min_sq);
        let weight = if mean > 0.0 { own / mean } else { 0.0 };
        let needs_ray = weight > 0.0 || self.settings.shadow.estimate == ShadowEstimate::Mean;
        (weight, needs_ray && shadow::is_vpl_seen(self.world, surface, vpl))
    }

    /// Draws a point from the variance of a grid light (the paper's form).
    fn ray_to_cloud(&self, surface: &SurfacePoint, light: &TileLight, key: u32) -> bool {
        let record = &level_of(self.grid, light.level).lights[light.index as usize];
        // Sum of three uniforms: close to normal, bounded at three standard deviations.
        let mut state = key;
        let mut uniform = || {
            state = hash_u32(state.wrapping_add(0x9e37_79b9));
            unit_f32(state) * 2.0 - 1.0
        };
        let mut normal = || uniform() + uniform() + uniform();
        let cloud = Vec3::new(normal(), normal(), normal());
        let target = record.position + cloud * record.variance.powf(0.5);
        shadow::is_point_seen(self.world, surface, target)
    }
}

/// Walks a tile's list for one row of receivers.
fn walk(row: &mut Row, list: &[TileLight], d_min_sq: f32, key: u32) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { walk_avx2(row, list, d_min_sq, key) };
    }
    walk_lanes(row, list, d_min_sq, key);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn walk_avx2(row: &mut Row, list: &[TileLight], d_min_sq: f32, key: u32) {
    walk_lanes(row, list, d_min_sq, key);
}

#[inline(always)]
fn walk_lanes(row: &mut Row, list: &[TileLight], d_min_sq: f32, key: u32) {
    let mut draws = 0u32;
    let (position, normal) = (row.position, row.normal);
    let (mut sum, mut evals, mut weight) = (row.sum, row.evals, row.weight);
    let mut next = if row.reservoirs.is_empty() { [f32::INFINITY; LANES] } else { row.next };
    for (index, light) in list.iter().enumerate() {
        let mut change = false;
        for i in 0..LANES {
            let x = light.position[0] - position[0][i];
            let y = light.position[1] - position[1][i];
            let z = light.position[2] - position[2][i];
            let dist_sq = x * x + y * y + z * z;
            let dist = dist_sq.sqrt();
            let rise = clamp01(dist * light.rise[0] + light.rise[1]);
            let fall = clamp01(dist * light.fall[0] + light.fall[1]);
            let blend = if rise < fall { rise } else { fall };
            let cos_x = normal[0][i] * x + normal[1][i] * y + normal[2][i] * z;
            let cos_l = -(light.normal[0] * x + light.normal[1] * y + light.normal[2] * z);
            let cosines = positive(cos_x) * positive(cos_l);
            let clamped = if dist_sq > d_min_sq { dist_sq } else { d_min_sq };
            let floor = dist_sq * clamped;
            let floor = if floor > 1e-30 { floor } else { 1e-30 };
            let share = blend * cosines / floor;
            sum[0][i] += light.intensity[0] * share;
            sum[1][i] += light.intensity[1] * share;
            sum[2][i] += light.intensity[2] * share;
            evals[i] += if share > 0.0 { 1.0 } else { 0.0 };
            weight[i] += light.shadow_weight * share;
            change |= weight[i] > next[i];
        }
        if change {
            for i in 0..LANES {
                if weight[i] <= next[i] {
                    continue;
                }
                next[i] = f32::INFINITY;
                for reservoir in &mut row.reservoirs {
                    if weight[i] > reservoir.next[i] {
                        reservoir.held[i] = index as u32;
                        draws += 1;
                        let u = unit_f32(hash_u32(key ^ hash_u32(draws))) + 0.5 / 16_777_216.0;
                        reservoir.next[i] = weight[i] / u;
                    }
                    next[i] = next[i].min(reservoir.next[i]);
                }
            }
        }
    }
    (row.sum, row.evals, row.weight, row.next) = (sum, evals, weight, next);
}

#[inline(always)]
fn positive(x: f32) -> f32 {
    if x > 0.0 { x } else { 0.0 }
}

#[inline(always)]
fn clamp01(x: f32) -> f32 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < 1.0 { x } else { 1.0 }
}

//! Gathering: each tile walks its light list once, keeping the sums in registers and the running
//! shadow weight after every run of lights.
//!
//! A shadow ray draws a light with probability proportional to its contribution: a point of the
//! total weight, the run it falls into by binary search, the light in it by its share.
//! That is the law of the weighted reservoirs of [LinYuksel19, App. A] (`[Chao82]`) by inversion,
//! so that the draws of a pixel and of its neighbors can be stratified.

use super::interleave::Tile;
use super::reach::choose_alpha;
use super::record::{GridLight, LightingGrid};
use super::tiles::{Bounds, Shell, TileLight, collect, level_of, narrow, shells};
use super::walk::{Draw, Row, TileList};
use crate::gather::Gathered;
use crate::math::{Sequence, hash_u32, morton_2d, unit_f32};
use crate::settings::{Settings, ShadowEstimate, ShadowTarget};
use crate::shadow;
use crate::surface::{Receivers, SurfacePoint};
use crate::vlight::vpl;
use crate::world::World;
use glam::Vec3;
use rayon::prelude::*;

/// Receivers per side of a tile.
pub const TILE: usize = 8;
/// Receivers per side of a block, whose tiles share one search of the grid.
const TILE_BLOCK: usize = BLOCK_TILES * TILE;
/// Tiles per side of a block, at least as many as interleaved sampling has classes.
const BLOCK_TILES: usize = 4;
/// Largest weight of a shadow ray: bounds what one virtual light says about a pixel where it gives
/// more than its grid light on average, as beside the horizon.
pub(super) const MOST_WEIGHT: f32 = 2.0;
/// Variance along an axis, in squared cells, below which lights lie in one plane: what is left when
/// the squared mean is taken from the mean of squares is rounding there, and would put every other
/// drawn point behind the wall that the lights are on.
pub(super) const FLAT: f32 = 1e-5;

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
    out.trust = vec![1.0; out.shadow_ratio.len()];
    let alpha = choose_alpha(grid, receivers, settings);
    out.alpha = Some(alpha);
    let shells = shells(grid, alpha);
    let job = Job { world, receivers, grid, settings, d_min, seed, shells: &shells };
    let (blocks_x, blocks_y) =
        (receivers.width.div_ceil(TILE_BLOCK), receivers.height.div_ceil(TILE_BLOCK));
    let blocks: Vec<Vec<(usize, PixelResult)>> = (0..blocks_x * blocks_y)
        .into_par_iter()
        .map_init(Scratch::default, |scratch, block| {
            job.gather_block(
                [block % blocks_x * TILE_BLOCK, block / blocks_x * TILE_BLOCK],
                scratch,
            )
        })
        .collect();
    for (index, result) in blocks.into_iter().flatten() {
        out.unshadowed[index] = result.unshadowed;
        [out.shadow_ratio[index], out.trust[index]] = result.shadow_ratio;
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
    /// And its trust.
    shadow_ratio: [f32; 2],
    evals: u32,
}

/// Memory that a thread keeps from tile to tile.
#[derive(Default)]
struct Scratch {
    /// Lights of a block.
    wider: Vec<TileLight>,
    /// Lights of a tile of it.
    list: TileList,
}

impl Job<'_> {
    fn gather_block(&self, [x, y]: [usize; 2], scratch: &mut Scratch) -> Vec<(usize, PixelResult)> {
        let mut results = Vec::new();
        let Some(bounds) = self.bounds(x, y, TILE_BLOCK) else { return results };
        collect(self.grid, self.shells, self.settings, &bounds, &mut scratch.wider);
        let side = self.settings.interleave as usize;
        for i in 0..BLOCK_TILES * BLOCK_TILES {
            let place = [x / TILE + i % BLOCK_TILES, y / TILE + i / BLOCK_TILES];
            let tile = Tile::new(place, side);
            let Some(bounds) = self.bounds_of_tile(&tile) else { continue };
            let class = tile.class(self.seed);
            narrow(&scratch.wider, class, self.shells, &bounds, &mut scratch.list);
            self.gather_tile(&tile, &mut scratch.list, &mut results);
        }
        results
    }

    /// Bounds of the receivers of a tile.
    fn bounds_of_tile(&self, tile: &Tile) -> Option<Bounds> {
        let Receivers { width, height, samples, .. } = self.receivers;
        let columns = tile.pixels(0, *width);
        let row = |y| columns.clone().map(move |x| &samples[y * width + x]);
        Bounds::of(tile.pixels(1, *height).flat_map(row).filter_map(|s| s.surface.as_ref()))
    }

    /// Bounds of the receivers in a square of pixels.
    fn bounds(&self, x: usize, y: usize, side: usize) -> Option<Bounds> {
        let Receivers { width, height, samples, .. } = self.receivers;
        let rows = y..(y + side).min(*height);
        let row = |y| &samples[y * width + x..y * width + (x + side).min(*width)];
        Bounds::of(rows.flat_map(row).filter_map(|s| s.surface.as_ref()))
    }

    fn gather_tile(
        &self,
        tile: &Tile,
        list: &mut TileList,
        results: &mut Vec<(usize, PixelResult)>,
    ) {
        let width = self.receivers.width;
        for y in tile.pixels(1, self.receivers.height) {
            let columns = tile.pixels(0, width);
            let mut row = self.start_row(columns.clone().map(|x| y * width + x));
            list.walk(&mut row, self.d_min * self.d_min);
            for (lane, x) in columns.enumerate() {
                let index = y * width + x;
                let Some(surface) = &self.receivers.samples[index].surface else { continue };
                let shadow_ratio = self.shadow_ratio([x, y], lane, surface, list);
                let unshadowed = Vec3::new(row.sum[0][lane], row.sum[1][lane], row.sum[2][lane]);
                let evals = row.evals[lane] as u32;
                results.push((index, PixelResult { unshadowed, shadow_ratio, evals }));
            }
        }
    }

    fn start_row(&self, pixels: impl Iterator<Item = usize>) -> Row {
        let mut row = Row::default();
        for (lane, pixel) in pixels.enumerate() {
            // The sums of lanes without surface are never read.
            let Some(surface) = &self.receivers.samples[pixel].surface else { continue };
            for axis in 0..3 {
                row.position[axis][lane] = surface.position[axis];
                row.normal[axis][lane] = surface.ns[axis];
            }
        }
        row
    }

    /// Draws and traces the shadow rays of one receiver: their ratio, and what one of them weighs.
    fn shadow_ratio(
        &self,
        pixel: [usize; 2],
        lane: usize,
        surface: &SurfacePoint,
        list: &TileList,
    ) -> [f32; 2] {
        let shadow = &self.settings.shadow;
        let d_min_sq = self.d_min * self.d_min;
        let total = list.total_weight(lane);
        if total <= 0.0 {
            return [1.0; 2];
        }
        let receiver = [surface.position.to_array(), surface.ns.to_array()];
        let (mut seen, mut drawn) = (0.0f32, 0.0f32);
        let morton = morton_2d(pixel[0] as u32, pixel[1] as u32);
        for ray in 0..shadow.rays {
            let index = morton.wrapping_mul(shadow.rays).wrapping_add(ray);
            let [u, v] = draw_numbers(shadow.stratified, self.seed, index);
            let Some(draw) = list.draw(u * total, receiver, lane, d_min_sq) else {
                continue;
            };
            let (weight, open) = match shadow.target {
                ShadowTarget::Vpl => self.ray_to_vpl(surface, &draw, v),
                ShadowTarget::Variance => {
                    (1.0, self.ray_to_cloud(surface, &draw, hash_u32(self.seed ^ hash_u32(index))))
                }
            };
            let weight = if shadow.estimate == ShadowEstimate::Mean { 1.0 } else { weight };
            drawn += weight;
            seen += if open { weight } else { 0.0 };
        }
        match shadow.rays {
            0 => [1.0; 2],
            rays if drawn > 0.0 => [seen / drawn, drawn / rays as f32],
            _ => [0.0; 2],
        }
    }

    /// Draws a real virtual light of a grid light; its contribution over its probability,
    /// relative to the running weight, and whether it is seen.
    fn ray_to_vpl(&self, surface: &SurfacePoint, draw: &Draw, u: f32) -> (f32, bool) {
        let drawn = match draw.level {
            0 => self.grid.level0_lights[draw.index as usize] as usize,
            level => self.grid.draw(level as usize, draw.index as usize, u),
        };
        let vpl = &self.grid.lights[drawn];
        let d_min_sq = self.d_min * self.d_min;
        let (p, n) = (surface.position, surface.ns);
        let own = vpl::geometry(vpl.position, vpl.normal, p, n, d_min_sq);
        let weight = (own / draw.geometry).min(MOST_WEIGHT);
        let needs_ray = weight > 0.0 || self.settings.shadow.estimate == ShadowEstimate::Mean;
        (weight, needs_ray && shadow::is_vpl_seen(self.world, surface, vpl))
    }

    /// Draws a point from the variance of a grid light (the paper's form).
    fn ray_to_cloud(&self, surface: &SurfacePoint, draw: &Draw, key: u32) -> bool {
        let level = level_of(self.grid, draw.level);
        let point = cloud_point(&level.lights[draw.index as usize], level.cell_size, key);
        shadow::is_point_seen(self.world, surface, point)
    }
}

/// A point in the spread of a grid light of a level.
pub(super) fn cloud_point(light: &GridLight, cell_size: f32, key: u32) -> Vec3 {
    // Sum of three uniforms: close to normal, bounded at three standard deviations.
    let mut state = key;
    let mut uniform = || {
        state = hash_u32(state.wrapping_add(0x9e37_79b9));
        unit_f32(state) * 2.0 - 1.0
    };
    let mut normal = || uniform() + uniform() + uniform();
    let cloud = Vec3::new(normal(), normal(), normal());
    let least = Vec3::splat(FLAT * cell_size * cell_size);
    let variance = Vec3::select(light.variance.cmpge(least), light.variance, Vec3::ZERO);
    light.position + cloud * variance.powf(0.5)
}

/// The random numbers of a ray by its index among all: for the grid light, and for the virtual
/// light in it.
pub(super) fn draw_numbers(stratified: bool, seed: u32, index: u32) -> [f32; 2] {
    match stratified {
        true => Sequence::new(seed, index).next_2d(),
        false => [0, 1].map(|i| unit_f32(hash_u32(seed ^ hash_u32(index.wrapping_mul(2) | i)))),
    }
}

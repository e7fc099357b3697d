//! Interleaved sampling: each of n × n neighboring pixels sees another n²-th part of the lights,
//! scaled by n².
//!
//! Paper: `[KellerHeidrich01]`, as in `[LinYuksel19]`; differs: gathered by tiles of receivers that
//! see the same lights; lights are dealt out by where they are, so that those next to each other
//! belong to different pixels; and virtual lights themselves are seen by every pixel.

use super::record::GridLight;
use super::sample::TILE;

/// Class of a light that every receiver sees.
pub(super) const EVERY: u32 = u32::MAX;
/// First level whose lights are dealt out: virtual lights themselves are few and near.
pub(super) const FIRST_LEVEL: u32 = 1;

/// What lights of a level shine for those that other receivers see.
pub(super) fn scale(level: u32, side: u32) -> f32 {
    if level >= FIRST_LEVEL { (side * side) as f32 } else { 1.0 }
}

/// Class of a light of a level out of `side`²: along each axis and in each plane of its lattice all
/// classes take turns.
pub(super) fn class_of(light: &GridLight, level: u32, side: u32) -> u32 {
    if level < FIRST_LEVEL {
        return EVERY;
    }
    let [x, y, z] = light.vertex.map(u32::from);
    (x + side * y + (2 * side - 1) * z + (2 * side + 1) * u32::from(light.lobe)) % (side * side)
}

/// Receivers of one class, in a square of pixels cut into one tile per class.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tile {
    /// First pixel.
    pub corner: [usize; 2],
    /// Pixels from one receiver to the next.
    pub side: usize,
}

impl Tile {
    /// The tile at a place among all tiles of the picture.
    pub(super) fn new(place: [usize; 2], side: usize) -> Self {
        Self { corner: place.map(|p| p / side * side * TILE + p % side), side }
    }

    /// The lights that it sees; a seed deals them out anew.
    pub(super) fn class(&self, seed: u32) -> u32 {
        let side = self.side as u32;
        let [x, y] = self.corner.map(|c| c as u32 % side);
        (x + side * y + seed % (side * side)) % (side * side)
    }

    /// Columns or rows of its pixels in a picture of some size.
    pub(super) fn pixels(&self, axis: usize, size: usize) -> impl Iterator<Item = usize> + Clone {
        let start = self.corner[axis];
        (start..size.min(start + TILE * self.side)).step_by(self.side)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Renderer;
    use crate::gather::grid::{DETAIL, LightingGrid, gather};
    use crate::settings::Settings;
    use crate::surface::{Receivers, ViewFrame};
    use crate::vlight::vpl;
    use glam::{Vec2, Vec3};

    #[test]
    fn tiles_cover_every_pixel_once_and_its_class_is_that_of_its_place() {
        let size = [70, 37];
        for side in [1, 2, 4] {
            let mut seen = vec![0; size[0] * size[1]];
            let tiles = size.map(|n: usize| n.div_ceil(4 * TILE) * 4);
            for i in 0..tiles[0] * tiles[1] {
                let tile = Tile::new([i % tiles[0], i / tiles[0]], side);
                for y in tile.pixels(1, size[1]) {
                    for x in tile.pixels(0, size[0]) {
                        seen[y * size[0] + x] += 1;
                        let place = x % side + side * (y % side);
                        assert_eq!(tile.class(3), (place as u32 + 3) % (side * side) as u32);
                    }
                }
            }
            assert!(seen.iter().all(|&n| n == 1), "side {side}");
        }
    }

    #[test]
    fn all_classes_take_turns_in_every_plane_of_the_lattice() {
        for side in [2u32, 4] {
            for axis in 0..3 {
                let mut counts = vec![0; (side * side) as usize];
                for i in 0..256u16 {
                    let mut vertex = [i % 16, i / 16, 0];
                    vertex.rotate_right(axis);
                    let light = GridLight { vertex, ..LIGHT };
                    counts[class_of(&light, 3, side) as usize] += 1;
                }
                assert!(counts.iter().all(|&n| n == 256 / (side * side)), "{side} {axis}");
            }
        }
    }

    const LIGHT: GridLight = GridLight {
        position: Vec3::ZERO,
        luminance: 1.0,
        intensity: Vec3::ONE,
        normal: Vec3::Z,
        variance: Vec3::ZERO,
        vertex: [0; 3],
        lobe: 0,
    };

    /// Every pixel sees the same point: what they know together is what each would know alone.
    #[test]
    fn the_parts_of_a_point_add_up() {
        let shot = manylight_scene::builtin("cornell").expect("cornell");
        let renderer = Renderer::new(shot.scene).expect("cornell");
        let view = ViewFrame::new(&shot.camera, 9, 9);
        let traced = Receivers::trace(&renderer.world, &view, Vec2::splat(0.5), true);
        let set = vpl::trace(&renderer.world, &renderer.emitters, 20_000, 3, 3, true);
        let mut settings = Settings::default();
        settings.shadow.rays = 0;
        let d_min = renderer.d_min(&settings);
        let grid = LightingGrid::build(&set.lights, &settings.grid, DETAIL * d_min);
        for i in [40, 76] {
            let sample = &traced.samples[i];
            assert!(sample.surface.is_some());
            let samples = vec![*sample; 32 * 32];
            let receivers = Receivers { width: 32, height: 32, samples };
            let sums = [1, 2, 4].map(|side| {
                settings.interleave = side;
                gather(&renderer.world, &receivers, &grid, &settings, d_min, 5)
            });
            assert!(sums[0].alpha == sums[1].alpha && sums[0].alpha == sums[2].alpha);
            let (whole, all) = (sums[0].unshadowed[0], sums[0].evals[0]);
            for (gathered, side) in sums[1..].iter().zip([2, 4]) {
                let window = (0..side * side).map(|i| i / side * 32 + i % side);
                let mean: Vec3 = window.clone().map(|i| gathered.unshadowed[i]).sum();
                let error = (mean / (side * side) as f32 / whole - 1.0).abs().max_element();
                assert!(error < 1e-4, "side {side}: {error}");
                // That no pixel knows much more than its part is what makes it fast.
                let evals: u32 = window.map(|i| gathered.evals[i]).sum();
                assert!(evals >= all && 4 * evals < 5 * all, "side {side}: {evals} of {all}");
            }
        }
    }
}

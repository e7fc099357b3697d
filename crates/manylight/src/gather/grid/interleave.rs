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

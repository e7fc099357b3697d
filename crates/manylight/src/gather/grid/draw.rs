//! Drawing one virtual light out of a grid light, in exact proportion to its share.
//!
//! A share is luminance × trilinear weight. Around a vertex the lights of one lobe lie in eight
//! cells. Inside a cell the weight is fixed by its values at the corners, so that the cells' own
//! shares to them give the mass of every cell in it: the draw goes down from cell to cell, and at
//! last from light to light. All sums are of positive terms in the cell's own coordinates: no
//! digits are lost at any number of levels. Only inside a crowded level-1 cell are they differences
//! of running sums, in double precision.

use super::build::BLOCK;
use super::cells::{Weight, mass};
use super::record::LightingGrid;
use std::ops::Range;

/// Most lights between two block boundaries that enclose a range.
pub(super) const MOST_SCANNED: usize = 2 * BLOCK;

/// The hat function of one vertex: Π (1 − |x/s − v|), x in level-1 cells.
struct Hat {
    /// 1/s: level-1 cells per cell of the level, inverted.
    scale: f32,
    vertex: [f32; 3],
}

impl Hat {
    /// Share of a light from its position and luminance.
    #[inline(always)]
    fn share(&self, &[x, y, z, luminance]: &[f32; 4]) -> f32 {
        let along = |x: f32, v: f32| (1.0 - (x * self.scale - v).abs()).max(0.0);
        let [u, v, w] = self.vertex;
        luminance * along(x, u) * along(y, v) * along(z, w)
    }
}

impl LightingGrid {
    /// Draws a virtual light of light `light` in level `level` (1…) for `u` in 0…1.
    ///
    /// Returns its position in `self.lights`; p = luminance · trilinear weight / luminance of the
    /// grid light.
    /// Cost: up to eight cells a level below, until few lights are left to scan
    pub fn draw(&self, level: usize, light: usize, u: f32) -> usize {
        // The cell around the vertex, by its known mass.
        let octants = &self.levels[level - 1].octants[light];
        let total: f32 = octants.luminance.iter().sum();
        let (octant, mut left) = choose(0, octants.luminance.into_iter().enumerate(), u * total);
        let mut cell = octants.cells[octant] as usize;

        // From cell to cell while there are many lights. The vertex is the corner on the other side
        // of the first.
        let corner = 7 - octant;
        let mut weight = Weight::of_corner(corner);
        let mut range = self.levels[level - 1].lights_of(cell);
        let scale = 1.0 / (1u32 << (level - 1)) as f32;
        for level in (1..level).rev() {
            if range.len() <= BLOCK {
                break;
            }
            let inner = self.levels[level].inner_of(cell);
            let first = inner.start;
            let cells = &self.levels[level - 1].cells[inner.clone()];
            let corners = weight.corners();
            let masses = inner.zip(cells.iter().map(|c| mass(&corners, &c.share)));
            (cell, left) = choose(first, masses, left);
            weight = weight.inside(cells[cell - first].octant);
            range = self.levels[level - 1].lights_of(cell);
        }
        // Any light inside tells where that first cell is.
        let inside = &self.points[range.start];
        let upper = |axis: usize| (corner >> axis & 1) as f32;
        let vertex = std::array::from_fn(|a| (inside[a] * scale).floor() + upper(a));
        self.draw_in(range, &Hat { scale, vertex }, &weight, left)
    }

    /// Draws a light of a cell: the one where the running mass passes `left`.
    ///
    /// A cell with more lights than a scan takes is one of level 1.
    fn draw_in(&self, range: Range<usize>, hat: &Hat, weight: &Weight, left: f32) -> usize {
        if range.len() <= MOST_SCANNED {
            return self.scan(range, hat, left);
        }
        // Whole blocks by prefix sums, the lights before and after them one by one.
        let (first, last) = (range.start.div_ceil(BLOCK), range.end / BLOCK);
        let corners = weight.corners().map(f64::from);
        let before = |block: usize| -> f32 {
            let (sum, base) = (&self.blocks[block], &self.blocks[first]);
            (0..8).map(|c| corners[c] * (sum[c] - base[c])).sum::<f64>() as f32
        };
        let parts =
            [range.start..first * BLOCK, first * BLOCK..last * BLOCK, last * BLOCK..range.end];
        let part_mass = |(i, part): (usize, &Range<usize>)| match i {
            1 => (i, before(last)),
            _ => (i, self.points[part.clone()].iter().map(|p| hat.share(p)).sum()),
        };
        let (part, left) = choose(0, parts.iter().enumerate().map(part_mass), left);
        if part != 1 {
            return self.scan(parts[part].clone(), hat, left);
        }
        // Last block that begins at or below the rest.
        let (mut low, mut high) = (first, last);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if before(middle) <= left { low = middle } else { high = middle }
        }
        self.scan(low * BLOCK..(low + 1) * BLOCK, hat, left - before(low))
    }

    /// The light of a short range where the running mass passes `left`.
    fn scan(&self, range: Range<usize>, hat: &Hat, left: f32) -> usize {
        let points = self.points[range.clone()].iter();
        let shares = points.map(|p| hat.share(p));
        choose(range.start, range.zip(shares), left).0
    }
}

/// The first of some things with masses at which their running sum passes `left`, and what is left
/// of it there.
///
/// Rounding may leave a rest behind the last: it goes to the last one with a mass, or to `first`
/// where there is none.
#[inline(always)]
fn choose(first: usize, masses: impl Iterator<Item = (usize, f32)>, mut left: f32) -> (usize, f32) {
    let mut chosen = (first, 0.0);
    for (i, mass) in masses.filter(|m| m.1 > 0.0) {
        chosen = (i, left.min(mass));
        if left < mass {
            break;
        }
        left -= mass;
    }
    chosen
}

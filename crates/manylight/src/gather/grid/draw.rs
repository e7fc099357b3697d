//! Drawing one virtual light out of a grid light, in exact proportion to its share.
//!
//! A share is luminance × trilinear weight. Around a vertex the lights of one lobe lie in eight
//! cells, each a contiguous range of the Morton order; within a cell the trilinear weight is a
//! product of three linear functions, so that prefix sums of eight monomials give the mass of any
//! run of blocks, and a draw is a binary search.

use super::build::{BLOCK, sort_key};
use super::record::{GridLight, LightingGrid};
use crate::math::luminance;
use crate::vlight::Vpl;
use glam::Vec3;
use std::ops::Range;

/// Most lights between two block boundaries that enclose a range.
const MOST_SCANNED: usize = 2 * BLOCK;

/// The trilinear weight around one vertex: Π (1 − |x/s − v|), x in level-1 cells.
struct VertexWeight {
    /// 1/s: level-1 cells per cell of the level, inverted.
    scale: f32,
    vertex: Vec3,
    /// +1 where the cell at hand lies below the vertex, −1 above: the sign of the slope.
    sign: Vec3,
}

impl VertexWeight {
    /// Share of a light from its lattice position and luminance.
    #[inline(always)]
    fn share(&self, [x, y, z, luminance]: [f32; 4]) -> f32 {
        let hat = 1.0 - (Vec3::new(x, y, z) * self.scale - self.vertex).abs();
        let hat = hat.max(Vec3::ZERO);
        luminance * hat.x * hat.y * hat.z
    }

    /// Coefficients of (1, x, y, z, xy, yz, zx, xyz) inside the cell at hand.
    fn coefficients(&self) -> [f64; 8] {
        let sign = self.sign.as_dvec3();
        let a = 1.0 - sign * self.vertex.as_dvec3();
        let b = sign * f64::from(self.scale);
        [
            a.x * a.y * a.z,
            b.x * a.y * a.z,
            a.x * b.y * a.z,
            a.x * a.y * b.z,
            b.x * b.y * a.z,
            a.x * b.y * b.z,
            b.x * a.y * b.z,
            b.x * b.y * b.z,
        ]
    }
}

impl LightingGrid {
    /// Position in level-1 cells and luminance, as the draw reads them.
    pub(super) fn draw_point(&self, light: &Vpl) -> [f32; 4] {
        let lattice = (light.position - self.origin) / self.levels[0].cell_size;
        lattice.extend(luminance(light.intensity)).to_array()
    }

    /// Sums of luminance · (1, x, y, z, xy, yz, zx, xyz) over some lights.
    pub(super) fn monomials(points: &[[f32; 4]]) -> [f64; 8] {
        let mut sums = [0.0; 8];
        for point in points {
            let [x, y, z, mass] = point.map(f64::from);
            let terms = [1.0, x, y, z, x * y, y * z, z * x, x * y * z];
            (0..8).for_each(|i| sums[i] += mass * terms[i]);
        }
        sums
    }

    /// Draws a virtual light of level `level` (1…) light `light` for `u` in 0…1.
    ///
    /// Returns its position in `self.lights`; p = luminance · trilinear weight / light.luminance.
    /// Cost: O(log n)
    pub fn draw(&self, level: usize, light: &GridLight, u: f32) -> usize {
        // The cell, by its known mass.
        let total: f32 = light.octants.iter().sum();
        let mut left = u * total;
        let mut octant = 0;
        for (i, &mass) in light.octants.iter().enumerate().filter(|(_, m)| **m > 0.0) {
            octant = i;
            if left < mass {
                break;
            }
            left -= mass;
        }
        let left = f64::from((left / light.octants[octant]).clamp(0.0, 1.0));

        // Its range in the Morton order.
        let shift = level as u32 - 1;
        let above = |axis: usize| octant >> axis & 1;
        let cell: [u32; 3] =
            std::array::from_fn(|a| u32::from(light.vertex[a]) + above(a) as u32 - 1);
        let depth = (self.levels.len() - level) as u32;
        let key = sort_key(u32::from(light.lobe), cell, depth);
        let cells = &self.levels[level - 1].cells;
        let at = cells.partition_point(|c| c.0 < key);
        debug_assert!(cells[at].0 == key, "a share lies in an occupied cell");
        let (start, end) = (cells[at].1 as usize, cells[at + 1].1 as usize);

        // The light inside it, by exact weights.
        let sign = Vec3::from_array(std::array::from_fn(|a| 1.0 - 2.0 * above(a) as f32));
        let vertex = Vec3::from_array(light.vertex.map(f32::from));
        let weight = VertexWeight { scale: 1.0 / (1u32 << shift) as f32, vertex, sign };
        self.draw_in(start..end, &weight, left)
    }

    fn draw_in(&self, range: Range<usize>, weight: &VertexWeight, u: f64) -> usize {
        let (first, last) = (range.start.div_ceil(BLOCK), range.end / BLOCK);
        if range.len() <= MOST_SCANNED {
            return self.scan(range, weight, |mass| u as f32 * mass);
        }
        // Whole blocks by prefix sums, the lights before and after them one by one.
        let coefficients = weight.coefficients();
        let before = |block: usize| -> f64 {
            let (sum, base) = (&self.blocks[block], &self.blocks[first]);
            (0..8).map(|i| coefficients[i] * (sum[i] - base[i])).sum()
        };
        let (head, tail) = (range.start..first * BLOCK, last * BLOCK..range.end);
        let mass = |r: &Range<usize>| -> f64 {
            self.points[r.clone()].iter().map(|&p| f64::from(weight.share(p))).sum()
        };
        let (head_mass, blocks_mass, tail_mass) = (mass(&head), before(last), mass(&tail));
        let target = u * (head_mass + blocks_mass + tail_mass);
        if target < head_mass {
            return self.scan(head, weight, |_| target as f32);
        }
        let target = target - head_mass;
        if target >= blocks_mass && tail_mass > 0.0 {
            return self.scan(tail, weight, |_| (target - blocks_mass) as f32);
        }
        // Last block that begins at or below the target.
        let (mut low, mut high) = (first, last);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if before(middle) <= target { low = middle } else { high = middle }
        }
        let rest = (target - before(low)) as f32;
        self.scan(low * BLOCK..(low + 1) * BLOCK, weight, |_| rest)
    }

    /// The light of a short range where the running mass passes a target, which may depend on
    /// the range's mass.
    fn scan(
        &self,
        range: Range<usize>,
        weight: &VertexWeight,
        target: impl Fn(f32) -> f32,
    ) -> usize {
        let mut shares = [0.0f32; MOST_SCANNED];
        let points = &self.points[range.clone()];
        let mut total = 0.0;
        for (share, &point) in shares.iter_mut().zip(points) {
            *share = weight.share(point);
            total += *share;
        }
        let mut left = target(total);
        // Rounding may leave a rest behind the last light: it goes to the last one with a share.
        let mut found = range.start.min(self.lights.len() - 1);
        for (i, &share) in shares[..points.len()].iter().enumerate() {
            if share > 0.0 {
                found = range.start + i;
                if left < share {
                    break;
                }
                left -= share;
            }
        }
        found
    }
}

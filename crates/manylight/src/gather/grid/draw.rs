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
use glam::{DVec3, Vec3};
use std::ops::Range;

/// The trilinear weight inside one cell next to a vertex: Π (a_d + b_d · u_d), u in 0…1 over the
/// cube.
struct CellWeight {
    constant: DVec3,
    slope: DVec3,
}

impl CellWeight {
    fn at(&self, unit: DVec3) -> f64 {
        (self.constant + self.slope * unit).max(DVec3::ZERO).element_product()
    }

    /// Coefficients of (1, x, y, z, xy, yz, zx, xyz).
    fn coefficients(&self) -> [f64; 8] {
        let (a, b) = (self.constant, self.slope);
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
    /// Position in 0…1 over the cube.
    fn unit(&self, p: Vec3) -> DVec3 {
        let edge = self.levels[0].cell_size * (1u32 << (self.levels.len() - 1)) as f32;
        (p - self.origin).as_dvec3() / f64::from(edge)
    }

    /// Sums of luminance · (1, x, y, z, xy, yz, zx, xyz) over some lights.
    pub(super) fn monomials(&self, lights: &[Vpl]) -> [f64; 8] {
        let edge = f64::from(self.levels[0].cell_size);
        let mut sums = [0.0; 8];
        for light in lights {
            // In level-1 cells here; `scale_monomials` turns them into units of the cube.
            let p = (light.position - self.origin).as_dvec3() / edge;
            let terms = [1.0, p.x, p.y, p.z, p.x * p.y, p.y * p.z, p.z * p.x, p.x * p.y * p.z];
            let mass = f64::from(luminance(light.intensity));
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
        let first_key = sort_key(u32::from(light.lobe), cell.map(|c| c << shift));
        let start = self.keys.partition_point(|&k| k < first_key);
        let end_key = first_key + (1u64 << (3 * shift));
        let end = start + self.keys[start..].partition_point(|&k| k < end_key);

        // The light inside it, by exact weights.
        let cells = f64::from(1u32 << (self.levels.len() as u32 - level as u32));
        let sign =
            DVec3::from_array(std::array::from_fn(|a| if above(a) == 1 { -1.0 } else { 1.0 }));
        let vertex = DVec3::from_array(light.vertex.map(f64::from));
        let weight = CellWeight { constant: 1.0 - sign * vertex, slope: sign * cells };
        self.draw_in(start..end, &weight, left)
    }

    fn draw_in(&self, range: Range<usize>, weight: &CellWeight, u: f64) -> usize {
        let (first, last) = (range.start.div_ceil(BLOCK), range.end / BLOCK);
        if last <= first + 1 {
            return self.scan(range.clone(), weight, u * self.mass(range, weight));
        }
        let fine = f64::from(1u32 << (self.levels.len() - 1));
        let scales = [1.0, fine, fine, fine, fine * fine, fine * fine, fine * fine, fine.powi(3)];
        let coefficients = weight.coefficients();
        let before = |block: usize| -> f64 {
            (0..8)
                .map(|i| {
                    coefficients[i] / scales[i] * (self.blocks[block][i] - self.blocks[first][i])
                })
                .sum()
        };
        let (head, tail) = (range.start..first * BLOCK, last * BLOCK..range.end);
        let (head_mass, tail_mass) =
            (self.mass(head.clone(), weight), self.mass(tail.clone(), weight));
        let blocks_mass = before(last);
        let target = u * (head_mass + blocks_mass + tail_mass);
        if target < head_mass {
            return self.scan(head, weight, target);
        }
        if target >= head_mass + blocks_mass && tail_mass > 0.0 {
            return self.scan(tail, weight, target - head_mass - blocks_mass);
        }
        // Last block that begins at or below the target.
        let target = target - head_mass;
        let (mut low, mut high) = (first, last);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if before(middle) <= target { low = middle } else { high = middle }
        }
        self.scan(low * BLOCK..(low + 1) * BLOCK, weight, target - before(low))
    }

    fn share(&self, index: usize, weight: &CellWeight) -> f64 {
        let light = &self.lights[index];
        f64::from(luminance(light.intensity)) * weight.at(self.unit(light.position))
    }

    fn mass(&self, range: Range<usize>, weight: &CellWeight) -> f64 {
        range.map(|i| self.share(i, weight)).sum()
    }

    /// The light of a non-empty range where the running mass passes `target`.
    fn scan(&self, range: Range<usize>, weight: &CellWeight, target: f64) -> usize {
        let mut left = target;
        let mut found = range.start.min(self.lights.len() - 1);
        for index in range {
            let share = self.share(index, weight);
            if share > 0.0 {
                found = index;
            }
            if left < share {
                break;
            }
            left -= share;
        }
        found
    }
}

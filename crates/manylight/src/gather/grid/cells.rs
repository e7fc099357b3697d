//! Occupied cells of a level: what lies in them, in the order of keys and by row.
//!
//! What lights share to the corners of a cell around them gives their mass under any weight that is
//! linear along each axis of the cell, as hat functions of its level and of coarser ones are: the
//! sum of the weight's values at the corners times the shares.

use super::record::Level;
use super::sort::{Keyed, position_of, sort_by_key};
use glam::Vec4;
use rayon::prelude::*;
use std::ops::Range;

/// A row (z, y) of vertices or of cells.
pub(super) type Row = [u16; 2];

/// What some lights share to each corner of a cell around them; bit a of the index is set at the
/// upper end of axis a.
pub(super) type Corners = [f32; 8];

/// An occupied cell with the lights of one lobe.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cell {
    /// Luminance shared to the corners of the coarser cell around it.
    pub share: Corners,
    /// First of its cells in the level below; none in level 1.
    pub inner: u32,
    /// First of its lights.
    pub light: u32,
    /// Which eighth of the coarser cell it is, bits as for corners.
    pub octant: u32,
}

/// A weight inside a cell: the product over the axes of a line through its values at the lower and
/// the upper end.
#[derive(Clone, Copy)]
pub(super) struct Weight(pub [[f32; 2]; 3]);

impl Weight {
    /// The hat function of one corner.
    pub(super) fn of_corner(corner: usize) -> Self {
        Self(std::array::from_fn(|a| if corner >> a & 1 == 1 { [0.0, 1.0] } else { [1.0, 0.0] }))
    }

    /// The same weight inside one eighth of the cell.
    pub(super) fn inside(self, octant: u32) -> Self {
        Self(std::array::from_fn(|a| {
            let [low, high] = self.0[a];
            let middle = 0.5 * (low + high);
            if octant >> a & 1 == 1 { [middle, high] } else { [low, middle] }
        }))
    }

    /// Values at the corners.
    #[inline(always)]
    pub(super) fn corners(&self) -> Corners {
        let [x, y, z] = self.0;
        std::array::from_fn(|c| x[c & 1] * y[c >> 1 & 1] * z[c >> 2])
    }
}

/// Mass of lights that share something to the corners of a cell, under a weight with some values
/// there.
#[inline(always)]
pub(super) fn mass(weight: &Corners, share: &Corners) -> f32 {
    let half = |c: &Corners, i: usize| Vec4::from_slice(&c[i..i + 4]);
    (half(weight, 0) * half(share, 0) + half(weight, 4) * half(share, 4)).element_sum()
}

/// What lights share to the corners of their level-1 cells, from positions in such cells and
/// luminances.
pub(super) fn share_of_points(points: &[[f32; 4]]) -> [f64; 8] {
    let mut share = [0.0; 8];
    for &[x, y, z, luminance] in points {
        let [x, y, z] = [x, y, z].map(f32::fract);
        let weight = Weight([[1.0 - x, x], [1.0 - y, y], [1.0 - z, z]]).corners();
        (0..8).for_each(|c| share[c] += f64::from(luminance * weight[c]));
    }
    share
}

/// What the lights of some cells share to the corners of the cell around them.
pub(super) fn share_of_cells(cells: &[Cell]) -> Corners {
    let add = |sum: Corners, cell: &Cell| std::array::from_fn(|c| sum[c] + cell.share[c]);
    cells.iter().fold([0.0; 8], add)
}

/// Cells from their keys with the first of what lies in them, a sentinel at the end, and what it
/// shares to their own corners; `fine` are the cells of the level below, if there are any.
pub(super) fn cells_of(keys: &[Keyed], shares: &[Corners], fine: Option<&[Cell]>) -> Vec<Cell> {
    let cell = |(i, &(key, first)): (usize, &Keyed)| {
        let octant = key as u32 % 8;
        let share = shares.get(i).map_or(Corners::default(), |share| widen(*share, octant));
        let (inner, light) = match fine {
            Some(fine) => (first, fine[first as usize].light),
            None => (0, first),
        };
        Cell { share, inner, light, octant }
    };
    keys.par_iter().enumerate().map(cell).collect()
}

/// What a cell shares to the corners of the coarser cell around it, from that to its own.
fn widen(mut share: Corners, octant: u32) -> Corners {
    for axis in 0..3 {
        for low in (0..8).filter(|c| c >> axis & 1 == 0) {
            let high = low | 1 << axis;
            let (a, b) = (share[low], share[high]);
            // The ends lie at 0 and ½ of the coarser cell, or at ½ and 1.
            (share[low], share[high]) = match octant >> axis & 1 {
                0 => (a + 0.5 * b, 0.5 * b),
                _ => (0.5 * a, 0.5 * a + b),
            };
        }
    }
    share
}

/// The cells of a level by row, x and lobe.
pub(super) struct CellRows {
    depth: u32,
    /// Row, x and lobe in one number; position of the cell among all.
    cells: Vec<Keyed>,
    /// Each row with its first in `cells`, and a sentinel.
    rows: Vec<(Row, u32)>,
}

impl CellRows {
    /// Sorts the cells with some keys, a sentinel at the end, `depth` halvings of the cube.
    pub(super) fn new(keys: &[Keyed], depth: u32) -> Self {
        let row_key = |(i, &(key, _)): (usize, &Keyed)| {
            let lobe = key >> (3 * depth);
            let [x, y, z] = position_of(key).map(|c| u64::from(c) & ((1 << depth) - 1));
            (((z << depth | y) << depth | x) << 3 | lobe, i as u32)
        };
        let cells = keys[..keys.len() - 1].par_iter().enumerate().map(row_key).collect();
        let cells = sort_by_key(cells, 3 * depth + 3);
        let mut rows: Vec<(Row, u32)> = Vec::new();
        for (i, (key, _)) in cells.iter().enumerate() {
            let row = key >> (depth + 3);
            let row = [row >> depth, row & ((1 << depth) - 1)].map(|c| c as u16);
            if rows.last().is_none_or(|r| r.0 != row) {
                rows.push((row, i as u32));
            }
        }
        rows.push(([u16::MAX; 2], cells.len() as u32));
        Self { depth, cells, rows }
    }

    /// All occupied rows.
    pub(super) fn rows(&self) -> &[(Row, u32)] {
        &self.rows
    }

    /// Positions of the cells, by row.
    pub(super) fn positions(&self) -> impl Iterator<Item = usize> {
        self.cells.iter().map(|c| c.1 as usize)
    }

    /// The cells of one row, as places in this order.
    pub(super) fn row(&self, row: [i32; 2]) -> Range<usize> {
        find_row(&self.rows, row)
    }

    /// x, lobe and position of a cell by its place in this order.
    pub(super) fn cell(&self, place: usize) -> (u16, u8, usize) {
        let (key, position) = self.cells[place];
        let x = key >> 3 & ((1 << self.depth) - 1);
        (x as u16, (key % 8) as u8, position as usize)
    }
}

/// What belongs to one row of a table with a sentinel.
pub(super) fn find_row(rows: &[(Row, u32)], [z, y]: [i32; 2]) -> Range<usize> {
    let (Ok(z), Ok(y)) = (u16::try_from(z), u16::try_from(y)) else { return 0..0 };
    match rows[..rows.len() - 1].binary_search_by(|r| r.0.cmp(&[z, y])) {
        Ok(at) => rows[at].1 as usize..rows[at + 1].1 as usize,
        Err(_) => 0..0,
    }
}

impl Level {
    /// The cells of the level below inside one cell.
    #[inline(always)]
    pub(super) fn inner_of(&self, cell: usize) -> Range<usize> {
        self.cells[cell].inner as usize..self.cells[cell + 1].inner as usize
    }

    /// The lights inside one cell.
    #[inline(always)]
    pub(super) fn lights_of(&self, cell: usize) -> Range<usize> {
        self.cells[cell].light as usize..self.cells[cell + 1].light as usize
    }
}

//! Building the hierarchy: sort once, sweep rows of vertices, add moments upward.
//!
//! Every sum runs in a fixed order inside one row, and rows are independent: the result has the
//! same bits at any thread count, without atomics.
//! Cost: one sort of the virtual lights and one of each level's cells, then 8 additions a light and
//! 3.4 a grid light.

use super::cells::{CellRows, Corners, cells_of, share_of_cells, share_of_points};
use super::record::{GridLight, Level, LightingGrid};
use super::sort::{Keyed, morton, sort_by_key};
use super::sweep::Lattice;
use crate::math::luminance;
use crate::settings::{GridSettings, MAX_LEVELS, MIN_LEVELS};
use crate::vlight::Vpl;
use glam::Vec3;
use rayon::prelude::*;

/// Virtual lights per block of prefix sums.
pub(super) const BLOCK: usize = 32;
/// Most lights of level 1 per virtual light.
const MOST_PER_VPL: usize = 4;
/// Bits of a sort key: three for the lobe, above three a level.
const KEY_BITS: u32 = 3 * MAX_LEVELS;
/// Lobe of lights that are left out: sorts them behind all others.
pub(super) const LEFT_OUT: u32 = 7;

impl LightingGrid {
    /// Builds the hierarchy over `lights`.
    ///
    /// Without a setting the number of levels is the largest for which level 1 has fewer lights
    /// than half the virtual lights, or more until level 1 resolves `detail`, the size in metres
    /// below which a cell brings nothing, as long as level 1 has no more than four lights per
    /// virtual light: a few lights far away must not coarsen the rest.
    ///
    /// Lights without intensity or with a value that is not finite are left out.
    /// Errors: never; without lights there are no levels
    pub fn build(lights: &[Vpl], settings: &GridSettings, detail: f32) -> Self {
        let (count, [low, high]) = bounds(lights);
        if count == 0 {
            return Self::default();
        }
        // A little room, so that the last light lies inside the last cell.
        let edge =
            ((high - low).max_element() * 1.0001).max(1e-4 * high.abs().max_element().max(1e-3));
        let lobes = if settings.lobes == 1 { 1 } else { 6 };
        let mut cube = Cube { origin: low, edge, level_count: MAX_LEVELS, lobes };
        let order = cube.sort(lights, count);
        cube.level_count = match settings.levels {
            Some(levels) => levels.clamp(MIN_LEVELS, MAX_LEVELS),
            None => cube.choose_level_count(&order, detail),
        };
        let lights: Vec<Vpl> = order.par_iter().map(|o| lights[o.1 as usize]).collect();
        loop {
            let keys = cube.occupied_cells(&order);
            let rows = CellRows::new(&keys, cube.depth(1));
            let (record_lights, firsts) = lights_by_row(&keys, &rows);
            let records = cube.records(&lights, &record_lights);
            let points: Vec<[f32; 4]> = lights.par_iter().map(|l| cube.point(l)).collect();
            let lights_of = |pair: &[Keyed]| &points[pair[0].1 as usize..pair[1].1 as usize];
            let share = |pair: &[Keyed]| share_of_points(lights_of(pair)).map(|s| s as f32);
            let shares: Vec<Corners> = keys.par_windows(2).map(share).collect();
            let first = cube.lattice(1).sweep_vpls(&records, &firsts, &rows, &shares);
            // Only now it is known how many vertices the cells share.
            let too_many =
                settings.levels.is_none() && first.lights.len() > MOST_PER_VPL * lights.len();
            if too_many && cube.level_count > MIN_LEVELS {
                cube.level_count -= 1;
                continue;
            }
            let (level0, level0_lights) = match settings.start_level {
                0 => (cube.level0(records, &firsts, &rows), record_lights),
                _ => Default::default(),
            };
            let levels =
                cube.levels(Level { cells: cells_of(&keys, &shares, None), ..first }, keys);
            let (origin, blocks) = (cube.origin, sum_blocks(&points));
            return Self { origin, levels, level0, level0_lights, lights, points, blocks };
        }
    }
}

/// Sums of what lights share to the corners of their own cells, before each block.
fn sum_blocks(points: &[[f32; 4]]) -> Vec<[f64; 8]> {
    let sums: Vec<[f64; 8]> = points.par_chunks(BLOCK).map(share_of_points).collect();
    let mut blocks = vec![[0.0; 8]];
    let mut running = [0.0; 8];
    for sum in sums {
        (0..8).for_each(|c| running[c] += sum[c]);
        blocks.push(running);
    }
    blocks
}

/// Whether a light takes part.
fn is_valid(light: &Vpl) -> bool {
    let is_finite =
        light.position.is_finite() && light.normal.is_finite() && light.intensity.is_finite();
    is_finite && luminance(light.intensity) > 0.0
}

/// Number and bounds of the lights that take part.
fn bounds(lights: &[Vpl]) -> (usize, [Vec3; 2]) {
    const NONE: (usize, [Vec3; 2]) = (0, [Vec3::INFINITY, Vec3::NEG_INFINITY]);
    let add = |(n, [low, high]): (usize, [Vec3; 2]), light: &Vpl| match is_valid(light) {
        true => (n + 1, [low.min(light.position), high.max(light.position)]),
        false => (n, [low, high]),
    };
    lights
        .par_iter()
        .fold(|| NONE, add)
        .reduce(|| NONE, |(n, [a, b]), (m, [c, d])| (n + m, [a.min(c), b.max(d)]))
}

/// The cube around all lights, cut into levels.
struct Cube {
    origin: Vec3,
    edge: f32,
    level_count: u32,
    lobes: u32,
}

/// Sort key: lobe above the interleaved bits of a cell, `depth` halvings of the cube.
///
/// The key of a coarser cell is that of any cell inside it, shifted by three bits a level.
fn sort_key(lobe: u32, cell: [u32; 3], depth: u32) -> u64 {
    u64::from(lobe) << (3 * depth) | morton(cell)
}

/// 0…5 for +x −x +y −y +z −z.
fn dominant_axis(normal: Vec3) -> u32 {
    let a = normal.abs();
    let axis = if a.x >= a.y && a.x >= a.z {
        0
    } else if a.y >= a.z {
        1
    } else {
        2
    };
    2 * axis as u32 + u32::from(normal[axis] < 0.0)
}

impl Cube {
    /// Halvings of the cube to the cells of a level.
    fn depth(&self, level: u32) -> u32 {
        self.level_count - level
    }

    /// Cells of a level along the cube's edge.
    fn cells(&self, level: u32) -> u32 {
        1 << self.depth(level)
    }

    fn cell_size(&self, level: u32) -> f32 {
        self.edge / self.cells(level) as f32
    }

    fn lattice(&self, level: u32) -> Lattice {
        let (cell_size, cells) = (self.cell_size(level), self.cells(level));
        Lattice { origin: self.origin, cell_size, cells, lobes: self.lobes }
    }

    /// Position in level-1 cells.
    ///
    /// Scaling by powers of two is exact: with fewer levels it is the same, halved.
    fn lattice_position(&self, p: Vec3) -> [f32; 3] {
        let lattice = (p - self.origin) * self.cell_size(1).recip();
        lattice.to_array().map(|c| c.max(0.0))
    }

    /// Level-1 cell of a position.
    fn cell_of(&self, p: Vec3) -> [u32; 3] {
        let last = self.cells(1) - 1;
        self.lattice_position(p).map(|c| (c as u32).min(last))
    }

    fn lobe_of(&self, normal: Vec3) -> u32 {
        if self.lobes == 1 { 0 } else { dominant_axis(normal) }
    }

    /// Sort key and index of every light that takes part, in order of the keys.
    fn sort(&self, lights: &[Vpl], count: usize) -> Vec<Keyed> {
        let key = |(i, light): (usize, &Vpl)| {
            let key = match is_valid(light) {
                true => {
                    let cell = self.cell_of(light.position);
                    sort_key(self.lobe_of(light.normal), cell, self.depth(1))
                }
                false => sort_key(LEFT_OUT, [0; 3], self.depth(1)),
            };
            (key, i as u32)
        };
        let keys = lights.par_iter().enumerate().map(key).collect();
        let mut order = sort_by_key(keys, KEY_BITS);
        order.truncate(count);
        order
    }

    /// The paper's number of levels, or more until cells resolve `detail`.
    fn choose_level_count(&self, order: &[Keyed], detail: f32) -> u32 {
        let cells = count_cells(order);
        // Every cell has eight vertices, shared by two to four neighbors on a surface.
        let fits = |l: &u32| 2 * cells[*l as usize] < order.len() / 2;
        let by_count = (MIN_LEVELS..=MAX_LEVELS).rev().find(fits).unwrap_or(MIN_LEVELS);
        let resolves = |l: &u32| Self { level_count: *l, ..*self }.cell_size(1) <= detail;
        (by_count..=MAX_LEVELS).find(resolves).unwrap_or(MAX_LEVELS)
    }

    /// Key of every occupied cell of level 1 with its first light, and a sentinel at the end.
    ///
    /// `order` has keys of the finest cells.
    fn occupied_cells(&self, order: &[Keyed]) -> Vec<Keyed> {
        let shift = 3 * (MAX_LEVELS - self.level_count);
        let keys = order.iter().enumerate().map(|(i, o)| (o.0 >> shift, i as u32));
        first_of_each(keys, order.len())
    }

    /// Position in level-1 cells and luminance of a light.
    fn point(&self, light: &Vpl) -> [f32; 4] {
        let [x, y, z] = self.lattice_position(light.position);
        [x, y, z, luminance(light.intensity)]
    }

    /// Some virtual lights as records in their cells of level 1.
    fn records(&self, lights: &[Vpl], order: &[u32]) -> Vec<GridLight> {
        let record = |&i: &u32| {
            let light = &lights[i as usize];
            GridLight {
                position: light.position,
                luminance: luminance(light.intensity),
                intensity: light.intensity,
                normal: light.normal,
                variance: Vec3::ZERO,
                vertex: self.cell_of(light.position).map(|c| c as u16),
                lobe: self.lobe_of(light.normal) as u8,
            }
        };
        order.par_iter().map(record).collect()
    }

    /// Level 0 from the virtual lights by row of their cells and the first of each cell.
    fn level0(&self, lights: Vec<GridLight>, firsts: &[u32], rows: &CellRows) -> Level {
        let rows = rows.rows().iter().map(|&(row, cell)| (row, firsts[cell as usize])).collect();
        Level { cell_size: self.cell_size(1), lights, rows, ..Level::default() }
    }

    /// All levels from the first and the keys of its cells with their first lights.
    fn levels(&self, first: Level, mut keys: Vec<Keyed>) -> Vec<Level> {
        let mut levels = vec![first];
        for level in 2..=self.level_count {
            let fine = &levels[levels.len() - 1];
            let count = keys.len() - 1;
            let coarser = keys[..count].iter().enumerate().map(|(i, k)| (k.0 >> 3, i as u32));
            keys = first_of_each(coarser, count);
            let inner = |pair: &[Keyed]| &fine.cells[pair[0].1 as usize..pair[1].1 as usize];
            let shares: Vec<Corners> =
                keys.par_windows(2).map(|pair| share_of_cells(inner(pair))).collect();
            let rows = CellRows::new(&keys, self.depth(level));
            let coarse = self.lattice(level).sweep_level(fine, &rows, &shares);
            levels.push(Level { cells: cells_of(&keys, &shares, Some(&fine.cells)), ..coarse });
        }
        levels
    }
}

/// The lights of cells with some keys in the order of the cells' rows, and the first of each cell
/// there, with the number of all at the end.
fn lights_by_row(keys: &[Keyed], rows: &CellRows) -> (Vec<u32>, Vec<u32>) {
    let count = keys.last().map_or(0, |sentinel| sentinel.1 as usize);
    let (mut order, mut firsts) = (Vec::with_capacity(count), Vec::with_capacity(keys.len()));
    for cell in rows.positions() {
        firsts.push(order.len() as u32);
        order.extend(keys[cell].1..keys[cell + 1].1);
    }
    firsts.push(order.len() as u32);
    (order, firsts)
}

/// Occupied cells by number of levels, from sorted keys of the finest cells.
fn count_cells(order: &[Keyed]) -> [usize; MAX_LEVELS as usize + 1] {
    // Pairs of neighbors by the most levels at which they still share a cell.
    let add = |mut counts: [usize; MAX_LEVELS as usize + 1], pair: &[Keyed]| {
        let different = pair[0].0 ^ pair[1].0;
        if different != 0 {
            let level = MAX_LEVELS - different.ilog2() / 3;
            counts[level as usize] += 1;
        }
        counts
    };
    let none = || [0; MAX_LEVELS as usize + 1];
    let sum = |a: [usize; MAX_LEVELS as usize + 1], b: [usize; MAX_LEVELS as usize + 1]| {
        std::array::from_fn(|i| a[i] + b[i])
    };
    let mut cells = order.par_windows(2).fold(none, add).reduce(none, sum);
    cells[0] += 1;
    for level in 1..cells.len() {
        cells[level] += cells[level - 1];
    }
    cells
}

/// Each key once, with the first of what belongs to it, and a sentinel at the end.
fn first_of_each(keys: impl Iterator<Item = Keyed>, end: usize) -> Vec<Keyed> {
    let mut cells: Vec<Keyed> = Vec::new();
    for (key, first) in keys {
        if cells.last().is_none_or(|c| c.0 != key) {
            cells.push((key, first));
        }
    }
    cells.push((u64::MAX, end as u32));
    cells
}

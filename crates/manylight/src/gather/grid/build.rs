//! Building the hierarchy: sort once, sweep rows of vertices, add moments upward.
//!
//! Every sum runs in a fixed order inside one row, and rows are independent: the result has the
//! same bits at any thread count, without atomics.
//! Cost: one sort of the virtual lights, then about 8 additions a light and 3.4 a grid light.

use super::record::{GridLight, Level, LightingGrid};
use crate::math::luminance;
use crate::settings::{GridSettings, MAX_LEVELS, MIN_LEVELS};
use crate::vlight::Vpl;
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// Virtual lights per block of prefix sums.
pub(super) const BLOCK: usize = 32;

impl LightingGrid {
    /// Builds the hierarchy over `lights`.
    ///
    /// Without a setting the number of levels is the largest for which level 1 has fewer lights
    /// than half the virtual lights, or more until level 1 resolves `detail`, the size in metres
    /// below which a cell brings nothing, as long as level 1 has fewer than four lights per
    /// virtual light: a few lights far away must not coarsen the rest.
    ///
    /// Lights without intensity or with a value that is not finite are left out.
    /// Errors: never; without lights there are no levels
    pub fn build(lights: &[Vpl], settings: &GridSettings, detail: f32) -> Self {
        let is_valid = |l: &&Vpl| {
            let is_finite =
                l.position.is_finite() && l.normal.is_finite() && l.intensity.is_finite();
            is_finite && luminance(l.intensity) > 0.0
        };
        let lights: Vec<Vpl> = lights.iter().filter(is_valid).copied().collect();
        if lights.is_empty() {
            return Self::default();
        }
        let fold = |[a, b]: [Vec3; 2], l: &Vpl| [a.min(l.position), b.max(l.position)];
        let [low, high] = lights.iter().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], fold);
        // A little room, so that the last light lies inside the last cell.
        let edge =
            ((high - low).max_element() * 1.0001).max(1e-4 * high.abs().max_element().max(1e-3));
        let mut cube = Cube { origin: low, edge, level_count: 0, lobes: settings.lobes };
        let levels = settings.levels.unwrap_or_else(|| cube.choose_level_count(&lights, detail));
        cube.level_count = levels;
        loop {
            let mut grid = cube.sort(&lights);
            let first = cube.sweep_vpls(&grid);
            // The estimate of vertices per cell may have been too low.
            let too_many = settings.levels.is_none() && first.len() > MOST_PER_VPL * lights.len();
            if too_many && cube.level_count > MIN_LEVELS {
                cube.level_count -= 1;
                continue;
            }
            cube.build_levels(&mut grid, first);
            if settings.start_level == 0 {
                cube.build_level0(&mut grid);
            }
            return grid;
        }
    }
}

/// Most lights of level 1 per virtual light.
const MOST_PER_VPL: usize = 4;

/// The lattice of the level at hand.
struct Cube {
    origin: Vec3,
    edge: f32,
    level_count: u32,
    lobes: u32,
}

/// Sort key: lobe above the interleaved bits of the cell of level `shift` + 1.
///
/// The key of a coarser cell is that of any level-1 cell inside it, shifted by three bits a level.
pub(super) fn sort_key(lobe: u32, cell: [u32; 3], shift: u32) -> u64 {
    let morton = spread(cell[0]) | spread(cell[1]) << 1 | spread(cell[2]) << 2;
    u64::from(lobe) << (3 * (MAX_LEVELS - shift)) | morton
}

/// First light of every occupied cell from sorted keys, with a sentinel at the end.
fn occupied_cells(keys: impl Iterator<Item = (u64, u32)>, count: usize) -> Vec<(u64, u32)> {
    let mut cells: Vec<(u64, u32)> = Vec::new();
    for (key, first) in keys {
        if cells.last().is_none_or(|c| c.0 != key) {
            cells.push((key, first));
        }
    }
    cells.push((u64::MAX, count as u32));
    cells
}

/// Puts two zero bits between the bits of a number below 2^21.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x);
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
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
    fn cells(&self) -> u32 {
        1 << (self.level_count - 1)
    }

    fn cell_size(&self) -> f32 {
        self.edge / self.cells() as f32
    }

    /// Position in units of level-1 cells.
    fn lattice(&self, p: Vec3) -> Vec3 {
        ((p - self.origin) / self.cell_size()).max(Vec3::ZERO)
    }

    fn cell_of(&self, p: Vec3) -> [u32; 3] {
        let cell = self.lattice(p).to_array().map(|c| c as u32);
        cell.map(|c| c.min(self.cells() - 1))
    }

    fn lobe_of(&self, normal: Vec3) -> u32 {
        if self.lobes == 1 { 0 } else { dominant_axis(normal) }
    }

    /// The paper's number of levels, or more until cells resolve `detail`.
    fn choose_level_count(&self, lights: &[Vpl], detail: f32) -> u32 {
        let by_count = self.levels_below(lights, lights.len() / 2);
        let resolves = |l: &u32| Cube { level_count: *l, ..*self }.cell_size() <= detail;
        let by_detail = (by_count..=MAX_LEVELS).find(resolves).unwrap_or(MAX_LEVELS);
        by_count.max(by_detail.min(self.levels_below(lights, MOST_PER_VPL * lights.len())))
    }

    /// The most levels for which level 1 has fewer lights than the limit, by an estimate.
    fn levels_below(&self, lights: &[Vpl], limit: usize) -> u32 {
        let finest = Cube { level_count: MAX_LEVELS, ..*self };
        let mut keys: Vec<u64> = lights
            .par_iter()
            .map(|l| sort_key(self.lobe_of(l.normal), finest.cell_of(l.position), 0))
            .collect();
        keys.par_sort_unstable();
        // A cell of level l begins where bits at or above 3·(its depth) change.
        let mut cells = [1usize; MAX_LEVELS as usize + 1];
        for pair in keys.windows(2) {
            let bit = 63 - (pair[0] ^ pair[1] | 1).leading_zeros();
            let same = pair[0] == pair[1];
            for (level, count) in cells.iter_mut().enumerate().skip(1) {
                let shift = 3 * (MAX_LEVELS - level as u32);
                *count += usize::from(!same && bit >= shift);
            }
        }
        // Every cell has eight vertices, shared by two to four neighbors on a surface.
        let fits = |l: &u32| 2 * cells[*l as usize] < limit;
        (MIN_LEVELS..=MAX_LEVELS).rev().find(fits).unwrap_or(MIN_LEVELS)
    }

    /// Sorts the lights by (lobe, Morton code) and sums up their blocks.
    fn sort(&self, lights: &[Vpl]) -> LightingGrid {
        let mut order: Vec<(u64, u32)> = lights
            .par_iter()
            .enumerate()
            .map(|(i, l)| (sort_key(self.lobe_of(l.normal), self.cell_of(l.position), 0), i as u32))
            .collect();
        order.par_sort_unstable();
        let count = order.len();
        let keys = order.iter().enumerate().map(|(i, o)| (o.0, i as u32));
        let cells = occupied_cells(keys, count);
        let sorted: Vec<Vpl> = order.par_iter().map(|o| lights[o.1 as usize]).collect();
        let mut grid = LightingGrid {
            origin: self.origin,
            levels: vec![Level { cell_size: self.cell_size(), cells, ..Level::default() }],
            level0: Level::default(),
            level0_lights: Vec::new(),
            lights: sorted,
            points: Vec::new(),
            blocks: Vec::new(),
        };
        grid.points = grid.lights.par_iter().map(|l| grid.draw_point(l)).collect();
        let sums: Vec<[f64; 8]> =
            grid.points.par_chunks(BLOCK).map(LightingGrid::monomials).collect();
        let mut running = [0.0; 8];
        for sum in sums {
            grid.blocks.push(running);
            (0..8).for_each(|i| running[i] += sum[i]);
        }
        grid.blocks.push(running);
        grid
    }

    /// Level 1: shares every virtual light among the eight vertices of its cell.
    fn sweep_vpls(&self, grid: &LightingGrid) -> Vec<GridLight> {
        let cells = self.cells() as usize;
        // Counting sort by cell row (z, y): rows are swept in order.
        let row_of = |l: &Vpl| {
            let [_, y, z] = self.cell_of(l.position);
            z as usize * cells + y as usize
        };
        let rows: Vec<u32> = grid.lights.par_iter().map(|l| row_of(l) as u32).collect();
        let mut order: Vec<(u32, u32)> =
            rows.iter().enumerate().map(|(i, &row)| (row, i as u32)).collect();
        order.par_sort_unstable();
        let vpl = |i: u32| {
            let l = &grid.lights[i as usize];
            let lattice = self.lattice(l.position);
            let cell = self.cell_of(l.position);
            (l, lattice, cell, self.lobe_of(l.normal))
        };
        let occupied = vertex_rows(
            order.iter().map(|o| [(o.0 as usize / cells) as i32, (o.0 as usize % cells) as i32]),
        );
        let sweep = |row: &mut RowSum, &[vz, vy]: &[i32; 2]| {
            for (cz, cy) in [(vz - 1, vy - 1), (vz - 1, vy), (vz, vy - 1), (vz, vy)] {
                if cz < 0 || cy < 0 || cz >= cells as i32 || cy >= cells as i32 {
                    continue;
                }
                let key = (cz as usize * cells + cy as usize) as u32;
                let start = order.partition_point(|o| o.0 < key);
                for &(_, i) in order[start..].iter().take_while(|o| o.0 == key) {
                    let (light, lattice, cell, lobe) = vpl(i);
                    let hat = |v: i32, x: f32| (1.0 - (x - v as f32).abs()).max(0.0);
                    let hat_zy = hat(vz, lattice.z) * hat(vy, lattice.y);
                    for vx in [cell[0] as i32, cell[0] as i32 + 1] {
                        let share = hat_zy * hat(vx, lattice.x);
                        let above = |c: i32, v: i32| usize::from(c >= v);
                        let octant =
                            above(cell[0] as i32, vx) | above(cy, vy) << 1 | above(cz, vz) << 2;
                        let vertex = IVec3::new(vx, vy, vz).as_vec3();
                        let p_vertex = self.origin + vertex * self.cell_size();
                        row.at(vx, lobe).add_vpl(light, share, light.position - p_vertex, octant);
                    }
                }
            }
            row.finish([vy, vz], self.origin, self.cell_size())
        };
        let new_row = || RowSum::new(cells + 1, self.lobes);
        let rows: Vec<_> = occupied.par_iter().with_min_len(4).map_init(new_row, sweep).collect();
        rows.concat()
    }

    /// Levels 2…L from the moments of the level below, and the row tables of all.
    fn build_levels(&self, grid: &mut LightingGrid, first: Vec<GridLight>) {
        grid.levels[0].lights = first;
        for level in 1..self.level_count {
            let cells = (self.cells() >> level) as usize;
            let cell_size = self.cell_size() * (1 << level) as f32;
            let fine = &grid.levels[level as usize - 1];
            let rows = occupied_rows(&fine.lights);
            let coarse = vertex_rows_above(&rows);
            let sweep = |row: &mut RowSum, &[vz, vy]: &[i32; 2]| {
                for dz in -1..=1 {
                    for dy in -1..=1 {
                        let (z, y) = (2 * vz + dz, 2 * vy + dy);
                        let key = [z as u16, y as u16];
                        let Ok(at) = rows.binary_search_by(|r| r.0.cmp(&key)) else { continue };
                        if z < 0 || y < 0 || at + 1 == rows.len() {
                            continue;
                        }
                        let weight = half(dz) * half(dy);
                        for light in &fine.lights[rows[at].1 as usize..rows[at + 1].1 as usize] {
                            let x = i32::from(light.vertex[0]);
                            for vx in x / 2..=(x + 1) / 2 {
                                let offset = IVec3::new(x - 2 * vx, dy, dz);
                                let share = weight * half(offset.x);
                                let shift = offset.as_vec3() * fine.cell_size;
                                let p_fine = self.origin
                                    + Vec3::from(light.vertex.map(f32::from)) * fine.cell_size;
                                row.at(vx, u32::from(light.lobe))
                                    .add_light(light, share, p_fine, shift, offset);
                            }
                        }
                    }
                }
                row.finish([vy, vz], self.origin, cell_size)
            };
            let new_row = || RowSum::new(cells + 1, self.lobes);
            let swept: Vec<_> =
                coarse.par_iter().with_min_len(4).map_init(new_row, sweep).collect();
            let lights = swept.concat();
            let inner = &fine.cells[..fine.cells.len() - 1];
            let cells = inner.iter().map(|c| (c.0 >> 3, c.1));
            let cells = occupied_cells(cells, grid.lights.len());
            grid.levels.push(Level { cell_size, lights, cells, rows: Vec::new() });
        }
        grid.levels.iter_mut().for_each(|l| l.rows = occupied_rows(&l.lights));
    }
}

impl Cube {
    /// The virtual lights themselves as records sorted by their cell.
    fn build_level0(&self, grid: &mut LightingGrid) {
        let key = |&i: &u32| {
            let [x, y, z] = self.cell_of(grid.lights[i as usize].position);
            [z, y, x, i]
        };
        let mut order: Vec<u32> = (0..grid.lights.len() as u32).collect();
        order.par_sort_unstable_by_key(key);
        let record = |&i: &u32| {
            let light = &grid.lights[i as usize];
            GridLight {
                position: light.position,
                luminance: luminance(light.intensity),
                intensity: light.intensity,
                normal: light.normal,
                variance: Vec3::ZERO,
                vertex: self.cell_of(light.position).map(|c| c as u16),
                lobe: 0,
                octants: [0.0; 8],
            }
        };
        let lights: Vec<GridLight> = order.par_iter().map(record).collect();
        let rows = occupied_rows(&lights);
        grid.level0 = Level { cell_size: self.cell_size(), lights, rows, cells: Vec::new() };
        grid.level0_lights = order;
    }
}

/// Value of a coarse hat function at a fine vertex `offset` fine cells away.
fn half(offset: i32) -> f32 {
    if offset == 0 { 1.0 } else { 0.5 }
}

/// Vertex rows touched by cell rows (z, y), sorted, each once.
fn vertex_rows(cell_rows: impl Iterator<Item = [i32; 2]>) -> Vec<[i32; 2]> {
    let mut rows: Vec<[i32; 2]> = Vec::new();
    let mut last = None;
    for [z, y] in cell_rows {
        if last != Some([z, y]) {
            rows.extend([[z, y], [z, y + 1], [z + 1, y], [z + 1, y + 1]]);
            last = Some([z, y]);
        }
    }
    rows.sort_unstable();
    rows.dedup();
    rows
}

/// Coarse vertex rows that fine vertex rows contribute to, sorted, each once.
fn vertex_rows_above(rows: &[([u16; 2], u32)]) -> Vec<[i32; 2]> {
    let mut coarse = Vec::new();
    for ([z, y], _) in &rows[..rows.len() - 1] {
        let (z, y) = (i32::from(*z), i32::from(*y));
        for cz in z / 2..=(z + 1) / 2 {
            coarse.extend((y / 2..=(y + 1) / 2).map(|cy| [cz, cy]));
        }
    }
    coarse.sort_unstable();
    coarse.dedup();
    coarse
}

/// First light of every occupied row, with a sentinel at the end.
fn occupied_rows(lights: &[GridLight]) -> Vec<([u16; 2], u32)> {
    let mut rows: Vec<([u16; 2], u32)> = Vec::new();
    for (i, light) in lights.iter().enumerate() {
        let row = [light.vertex[2], light.vertex[1]];
        if rows.last().is_none_or(|r| r.0 != row) {
            rows.push((row, i as u32));
        }
    }
    rows.push(([u16::MAX; 2], lights.len() as u32));
    rows
}

/// Moments of one vertex and lobe; positions are relative to the vertex.
#[derive(Clone, Copy, Default)]
struct Moments {
    intensity: Vec3,
    luminance: f32,
    /// Σ luminance · offset and offset².
    offset: Vec3,
    offset_sq: Vec3,
    normal: Vec3,
    octants: [f32; 8],
}

impl Moments {
    fn add_vpl(&mut self, light: &Vpl, share: f32, offset: Vec3, octant: usize) {
        let mass = luminance(light.intensity) * share;
        self.intensity += light.intensity * share;
        self.luminance += mass;
        self.offset += offset * mass;
        self.offset_sq += offset * offset * mass;
        self.normal += light.normal * mass;
        self.octants[octant] += mass;
    }

    /// Adds a share of a finer vertex that lies `shift` metres, `offset` fine cells away.
    fn add_light(&mut self, l: &GridLight, share: f32, p_fine: Vec3, shift: Vec3, offset: IVec3) {
        let mass = l.luminance * share;
        let mean = l.position - p_fine + shift;
        self.intensity += l.intensity * share;
        self.luminance += mass;
        self.offset += mean * mass;
        self.offset_sq += (l.variance + mean * mean) * mass;
        self.normal += l.normal * mass;
        for (octant, &part) in l.octants.iter().enumerate() {
            // The fine cell's side of the coarse vertex along each axis.
            let side = |axis: usize| {
                let above = octant >> axis & 1 == 1;
                usize::from(if offset[axis] == 0 { above } else { offset[axis] > 0 })
            };
            self.octants[side(0) | side(1) << 1 | side(2) << 2] += part * share;
        }
    }
}

/// Sums of one row of vertices, kept by a thread from row to row: what a row costs depends on the
/// lights near it, not on its length.
struct RowSum {
    /// Position in `sums` of each vertex and lobe, plus one; 0 where there is none.
    slots: Vec<u32>,
    sums: Vec<(u32, Moments)>,
    lobes: u32,
}

impl RowSum {
    fn new(vertices: usize, lobes: u32) -> Self {
        Self { slots: vec![0; vertices * lobes as usize], sums: Vec::new(), lobes }
    }

    fn at(&mut self, x: i32, lobe: u32) -> &mut Moments {
        let key = x as u32 * self.lobes + lobe;
        let slot = &mut self.slots[key as usize];
        if *slot == 0 {
            self.sums.push((key, Moments::default()));
            *slot = self.sums.len() as u32;
        }
        &mut self.sums[*slot as usize - 1].1
    }

    /// The lights of the occupied vertices; leaves the sums empty.
    fn finish(&mut self, [y, z]: [i32; 2], origin: Vec3, cell_size: f32) -> Vec<GridLight> {
        self.sums.iter().for_each(|s| self.slots[s.0 as usize] = 0);
        self.sums.sort_unstable_by_key(|s| s.0);
        let occupied = self.sums.drain(..).filter(|(_, m)| m.luminance > 0.0);
        occupied
            .map(|(key, m)| {
                let vertex = [(key / self.lobes) as u16, y as u16, z as u16];
                let mean = m.offset / m.luminance;
                let p_vertex = origin + Vec3::from(vertex.map(f32::from)) * cell_size;
                GridLight {
                    position: p_vertex + mean,
                    luminance: m.luminance,
                    intensity: m.intensity,
                    normal: m.normal / m.luminance,
                    variance: (m.offset_sq / m.luminance - mean * mean).max(Vec3::ZERO),
                    vertex,
                    lobe: (key % self.lobes) as u8,
                    octants: m.octants,
                }
            })
            .collect()
    }
}

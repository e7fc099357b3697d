//! Summing up levels: rows of vertices collect the lights around them.

use super::record::{GridLight, Level};
use glam::{IVec3, Vec3, Vec3A, Vec4};
use rayon::prelude::*;

/// Most and shortest parts that a level is swept in.
const MOST_PARTS: usize = 256;
const PART_LEN: usize = 16;

/// A row (z, y) of vertices or of cells.
pub(super) type Row = [u16; 2];

/// The lattice of one level.
#[derive(Clone, Copy)]
pub(super) struct Lattice {
    pub origin: Vec3,
    pub cell_size: f32,
    /// Cells per axis.
    pub cells: u32,
    pub lobes: u32,
}

impl Lattice {
    /// Level 1: shares every virtual light among the eight vertices of its cell.
    ///
    /// `lights` are the virtual lights as records, by row of their cells.
    /// Cost: four reads and eight sums a light, the reads in order
    pub(super) fn sweep_vpls(&self, lights: &Level, cell_rows: &[Row]) -> Level {
        self.sweep(cell_rows, |sum, [vz, vy]| {
            // Whether the vertex lies above the cell's lower end.
            for (dz, dy) in [(1, 1), (1, 0), (0, 1), (0, 0)] {
                let row = lights.row([i32::from(vz) - dz, i32::from(vy) - dy]);
                for cell in row.chunk_by(|a, b| (a.vertex[0], a.lobe) == (b.vertex[0], b.lobe)) {
                    let first = &cell[0];
                    let sums = self.sum_cell(cell, dz as f32, dy as f32);
                    for (dx, corner) in sums.iter().enumerate() {
                        let octant = (1 - dx) | ((1 - dy) << 1 | (1 - dz) << 2) as usize;
                        let vertex = sum.at(first.vertex[0] + dx as u16, first.lobe);
                        vertex.moments.add(corner);
                        vertex.octants[octant] += corner.light.w;
                    }
                }
            }
        })
    }

    /// The lights of one cell as its corners at the lower and the upper x see them.
    #[inline(always)]
    fn sum_cell(&self, lights: &[GridLight], dz: f32, dy: f32) -> [Moments; 2] {
        let low = Vec3A::from_array(lights[0].vertex.map(f32::from));
        let (origin, scale) = (Vec3A::from(self.origin), self.cell_size.recip());
        let mut sums = [Moments::default(); 2];
        for light in lights {
            let p = (Vec3A::from(light.position) - origin) * scale - low;
            let p = p.clamp(Vec3A::ZERO, Vec3A::ONE);
            let hat_zy = (1.0 - dz - p.z).abs() * (1.0 - dy - p.y).abs();
            let offset = p - Vec3A::new(0.0, dy, dz);
            sums[0].add_share(light, hat_zy * (1.0 - p.x), offset, Vec3A::ZERO);
            sums[1].add_share(light, hat_zy * p.x, offset - Vec3A::X, Vec3A::ZERO);
        }
        sums
    }

    /// A coarser level from the moments of the level below.
    ///
    /// Cost: 3.4 additions a grid light of the level below
    pub(super) fn sweep_level(&self, fine: &Level, cell_rows: &[Row]) -> Level {
        let scale = self.cell_size.recip();
        self.sweep(cell_rows, |sum, [vz, vy]| {
            for dz in -1..=1 {
                for dy in -1..=1 {
                    let (z, y) = (2 * i32::from(vz) + dz, 2 * i32::from(vy) + dy);
                    let weight = half(dz) * half(dy);
                    for light in fine.row([z, y]) {
                        let x = i32::from(light.vertex[0]);
                        let p_fine =
                            self.origin + Vec3::from(light.vertex.map(f32::from)) * fine.cell_size;
                        let inside = (light.position - p_fine) * scale;
                        let variance = Vec3A::from(light.variance * (scale * scale));
                        for vx in x / 2..=(x + 1) / 2 {
                            let offset = IVec3::new(x - 2 * vx, dy, dz);
                            let mean = Vec3A::from(inside + 0.5 * offset.as_vec3());
                            let share = weight * half(offset.x);
                            let vertex = sum.at(vx as u16, light.lobe);
                            vertex.moments.add_share(light, share, mean, variance);
                            vertex.add_octants(&light.octants, share, offset);
                        }
                    }
                }
            }
        })
    }

    /// The lights of all vertices of some rows of cells.
    fn sweep(&self, cell_rows: &[Row], add: impl Fn(&mut RowSum, Row) + Sync) -> Level {
        let rows = vertex_rows(cell_rows);
        let sweep_part = |rows: &[Row]| {
            let mut sum = RowSum::new(self);
            let mut part = Level::default();
            for &row in rows {
                add(&mut sum, row);
                sum.finish(row, self, &mut part);
            }
            part
        };
        let part_len = rows.len().div_ceil(MOST_PARTS).max(PART_LEN);
        let parts: Vec<Level> = rows.par_chunks(part_len).map(sweep_part).collect();
        join(&parts, self.cell_size)
    }
}

/// Value of a coarse hat function at a fine vertex `offset` fine cells away.
fn half(offset: i32) -> f32 {
    if offset == 0 { 1.0 } else { 0.5 }
}

/// Rows of the vertices of cells, sorted, each once.
fn vertex_rows(cell_rows: &[Row]) -> Vec<Row> {
    let mut rows = Vec::with_capacity(4 * cell_rows.len());
    for dz in 0..=1 {
        rows.extend(cell_rows.iter().flat_map(|[z, y]| [[z + dz, *y], [z + dz, y + 1]]));
    }
    // Two sorted runs: this sort merges them.
    rows.sort();
    rows.dedup();
    rows
}

/// Rows of the cells of twice the size, sorted, each once.
pub(super) fn coarser_rows(cell_rows: &[Row]) -> Vec<Row> {
    let mut rows: Vec<Row> = cell_rows.iter().map(|row| row.map(|c| c / 2)).collect();
    rows.dedup();
    rows.sort();
    rows.dedup();
    rows
}

/// One level from parts that follow each other.
fn join(parts: &[Level], cell_size: f32) -> Level {
    let (mut starts, mut rows, mut count) = (Vec::new(), Vec::new(), 0);
    for part in parts {
        starts.push(count);
        rows.extend(part.rows.iter().map(|r| (r.0, r.1 + count as u32)));
        count += part.lights.len();
    }
    rows.push(([u16::MAX; 2], count as u32));
    let light = |i: usize| {
        let part = starts.partition_point(|&start| start <= i) - 1;
        parts[part].lights[i - starts[part]]
    };
    let lights = (0..count).into_par_iter().map(light).collect();
    Level { cell_size, lights, rows, cells: Vec::new() }
}

impl Level {
    /// The lights of one row (z, y).
    fn row(&self, [z, y]: [i32; 2]) -> &[GridLight] {
        let (Ok(z), Ok(y)) = (u16::try_from(z), u16::try_from(y)) else { return &[] };
        let inner = &self.rows[..self.rows.len() - 1];
        let Ok(at) = inner.binary_search_by(|r| r.0.cmp(&[z, y])) else { return &[] };
        &self.lights[self.rows[at].1 as usize..self.rows[at + 1].1 as usize]
    }
}

/// Sums over the shares around one vertex; lengths in cells, positions relative to the vertex.
#[derive(Clone, Copy, Default)]
struct Moments {
    /// Σ intensity and Σ luminance.
    light: Vec4,
    /// Σ luminance · offset and offset².
    offset: Vec3A,
    offset_sq: Vec3A,
    /// Σ luminance · normal.
    normal: Vec3A,
}

impl Moments {
    #[inline(always)]
    fn add_share(&mut self, light: &GridLight, share: f32, mean: Vec3A, variance: Vec3A) {
        let mass = light.luminance * share;
        self.light += light.intensity.extend(light.luminance) * share;
        self.offset += mean * mass;
        self.offset_sq += (variance + mean * mean) * mass;
        self.normal += Vec3A::from(light.normal) * mass;
    }

    fn add(&mut self, other: &Self) {
        self.light += other.light;
        self.offset += other.offset;
        self.offset_sq += other.offset_sq;
        self.normal += other.normal;
    }
}

/// Sums of one vertex and lobe.
#[derive(Clone, Copy, Default)]
struct VertexSum {
    moments: Moments,
    octants: [f32; 8],
}

impl VertexSum {
    /// Adds a share of the octants of a finer vertex `offset` fine cells away.
    fn add_octants(&mut self, octants: &[f32; 8], share: f32, offset: IVec3) {
        for (octant, &part) in octants.iter().enumerate() {
            // The fine cell's side of the coarse vertex along each axis.
            let side = |axis: usize| {
                let above = octant >> axis & 1 == 1;
                usize::from(if offset[axis] == 0 { above } else { offset[axis] > 0 })
            };
            self.octants[side(0) | side(1) << 1 | side(2) << 2] += part * share;
        }
    }
}

/// Sums of one row of vertices, kept from row to row: what a row costs depends on the lights near
/// it, not on its length.
struct RowSum {
    /// Position in `sums` of each vertex and lobe, plus one; 0 where there is none.
    slots: Vec<u32>,
    /// Vertex and lobe of each sum.
    keys: Vec<u32>,
    sums: Vec<VertexSum>,
    lobes: u32,
}

impl RowSum {
    fn new(lattice: &Lattice) -> Self {
        let slots = vec![0; ((lattice.cells + 1) * lattice.lobes) as usize];
        Self { slots, keys: Vec::new(), sums: Vec::new(), lobes: lattice.lobes }
    }

    fn at(&mut self, x: u16, lobe: u8) -> &mut VertexSum {
        let key = u32::from(x) * self.lobes + u32::from(lobe);
        let slot = &mut self.slots[key as usize];
        if *slot == 0 {
            self.keys.push(key);
            self.sums.push(VertexSum::default());
            *slot = self.sums.len() as u32;
        }
        &mut self.sums[*slot as usize - 1]
    }

    /// Appends the row and its lights to a level; leaves the sums empty.
    fn finish(&mut self, [z, y]: Row, lattice: &Lattice, level: &mut Level) {
        let first = level.lights.len();
        self.keys.sort_unstable();
        for key in self.keys.drain(..) {
            let slot = std::mem::take(&mut self.slots[key as usize]);
            let VertexSum { moments: m, octants } = self.sums[slot as usize - 1];
            let mass = m.light.w;
            if mass <= 0.0 {
                continue;
            }
            let vertex = [(key / self.lobes) as u16, y, z];
            let mean = m.offset / mass;
            let p_vertex = lattice.origin + Vec3::from(vertex.map(f32::from)) * lattice.cell_size;
            let variance = (m.offset_sq / mass - mean * mean).max(Vec3A::ZERO);
            level.lights.push(GridLight {
                position: p_vertex + Vec3::from(mean) * lattice.cell_size,
                luminance: mass,
                intensity: m.light.truncate(),
                normal: Vec3::from(m.normal / mass),
                variance: Vec3::from(variance) * (lattice.cell_size * lattice.cell_size),
                vertex,
                lobe: (key % self.lobes) as u8,
                octants,
            });
        }
        self.sums.clear();
        if level.lights.len() > first {
            level.rows.push(([z, y], first as u32));
        }
    }
}

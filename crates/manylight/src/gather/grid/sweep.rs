//! Summing up levels: rows of vertices collect the lights around them.

use super::cells::{CellRows, Corners, Row, find_row};
use super::record::{GridLight, Level, Octants};
use glam::{IVec3, Vec3, Vec3A, Vec4};
use rayon::prelude::*;

/// Most and shortest parts that a level is swept in.
const MOST_PARTS: usize = 256;
const PART_LEN: usize = 16;

/// Whether a row of vertices lies at the upper end, in z and y, of the cells in each of the four
/// rows around it.
const SIDES: [[i32; 2]; 4] = [[1, 1], [1, 0], [0, 1], [0, 0]];

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
    /// `records` are the virtual lights by row of their cells, `firsts` the first of each cell
    /// there, `shares` what each cell shares to its corners.
    /// Cost: four reads and eight sums a light, the reads in order
    pub(super) fn sweep_vpls(
        &self,
        records: &[GridLight],
        firsts: &[u32],
        rows: &CellRows,
        shares: &[Corners],
    ) -> Level {
        self.sweep(rows, shares, |sum, [vz, vy]| {
            for [dz, dy] in SIDES {
                for place in rows.row([i32::from(vz) - dz, i32::from(vy) - dy]) {
                    let (x, lobe, _) = rows.cell(place);
                    let lights = &records[firsts[place] as usize..firsts[place + 1] as usize];
                    let [lower, upper] = self.sum_cell(lights, dz as f32, dy as f32);
                    sum.at(x, lobe).moments.add(&lower);
                    sum.at(x + 1, lobe).moments.add(&upper);
                }
            }
        })
    }

    /// Position inside a cell, 0…1 along each axis.
    #[inline(always)]
    pub(super) fn inside(&self, position: Vec3, cell: [u16; 3]) -> Vec3A {
        let scaled = Vec3A::from(position - self.origin) * self.cell_size.recip();
        (scaled - Vec3A::from_array(cell.map(f32::from))).clamp(Vec3A::ZERO, Vec3A::ONE)
    }

    /// The lights of one cell as its corners at the lower and the upper x see them.
    #[inline(always)]
    fn sum_cell(&self, lights: &[GridLight], dz: f32, dy: f32) -> [Moments; 2] {
        let mut sums = [Moments::default(); 2];
        for light in lights {
            let p = self.inside(light.position, light.vertex);
            let hat_zy = (1.0 - dz - p.z).abs() * (1.0 - dy - p.y).abs();
            let offset = p - Vec3A::new(0.0, dy, dz);
            sums[0].add_share(light, hat_zy * (1.0 - p.x), offset, Vec3A::ZERO);
            sums[1].add_share(light, hat_zy * p.x, offset - Vec3A::X, Vec3A::ZERO);
        }
        sums
    }

    /// A coarser level from the moments of the level below, and what its cells share to their
    /// corners.
    ///
    /// Cost: 3.4 additions a grid light of the level below
    pub(super) fn sweep_level(&self, fine: &Level, rows: &CellRows, shares: &[Corners]) -> Level {
        let scale = self.cell_size.recip();
        self.sweep(rows, shares, |sum, [vz, vy]| {
            for dz in -1..=1 {
                for dy in -1..=1 {
                    let (z, y) = (2 * i32::from(vz) + dz, 2 * i32::from(vy) + dy);
                    let weight = half(dz) * half(dy);
                    for light in &fine.lights[find_row(&fine.rows, [z, y])] {
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
                        }
                    }
                }
            }
        })
    }

    /// The lights of all vertices of some cells.
    fn sweep(
        &self,
        cell_rows: &CellRows,
        shares: &[Corners],
        add: impl Fn(&mut RowSum, Row) + Sync,
    ) -> Level {
        let rows = vertex_rows(cell_rows.rows());
        let sweep_part = |rows: &[Row]| {
            let mut sum = RowSum::new(self);
            let mut part = Level::default();
            for &row in rows {
                add(&mut sum, row);
                sum.add_octants(row, cell_rows, shares);
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

/// Rows of the vertices of cells in some rows, sorted, each once.
fn vertex_rows(cell_rows: &[(Row, u32)]) -> Vec<Row> {
    let inner = &cell_rows[..cell_rows.len() - 1];
    let mut rows = Vec::with_capacity(4 * inner.len());
    for dz in 0..=1 {
        rows.extend(inner.iter().flat_map(|([z, y], _)| [[z + dz, *y], [z + dz, y + 1]]));
    }
    // Two sorted runs: this sort merges them.
    rows.sort();
    rows.dedup();
    rows
}

/// One level from parts that follow each other, without its cells.
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
        let at = i - starts[part];
        (parts[part].lights[at], parts[part].octants[at])
    };
    let (mut lights, mut octants) = (Vec::new(), Vec::new());
    (0..count).into_par_iter().map(light).unzip_into_vecs(&mut lights, &mut octants);
    Level { cell_size, lights, octants, rows, cells: Vec::new() }
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
    octants: Octants,
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

    /// What the vertices of a row take from each cell around them.
    fn add_octants(&mut self, [vz, vy]: Row, rows: &CellRows, shares: &[Corners]) {
        for [dz, dy] in SIDES {
            for place in rows.row([i32::from(vz) - dz, i32::from(vy) - dy]) {
                let (x, lobe, position) = rows.cell(place);
                for dx in 0..=1 {
                    let corner = dx | (dy << 1 | dz << 2) as usize;
                    let octants = &mut self.at(x + dx as u16, lobe).octants;
                    // Seen from its corner, the cell lies on the other side.
                    octants.luminance[7 - corner] = shares[position][corner];
                    octants.cells[7 - corner] = position as u32;
                }
            }
        }
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
            });
            level.octants.push(octants);
        }
        self.sums.clear();
        if level.lights.len() > first {
            level.rows.push(([z, y], first as u32));
        }
    }
}

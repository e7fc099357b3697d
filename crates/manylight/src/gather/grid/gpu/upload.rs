//! A hierarchy that the processor built, in the layout of the device.

use super::record::{
    BLOCK, CellRecord, GpuGrid, GridInfo, GridLightRecord, LevelInfo, OctantsRecord, SUPERBLOCK,
};
use crate::error::Error;
use crate::gather::grid::LightingGrid;
use crate::gather::grid::cells::{Cell, share_of_points};
use crate::gather::grid::record::{GridLight, Level, Octants};
use crate::gpu::Gpu;
use crate::vlight::vpl::gpu::VplRecord;

/// All lists of a hierarchy; see [`GpuGrid`].
#[derive(Debug, Default)]
pub struct PackedGrid {
    /// Where the levels lie.
    pub info: GridInfo,
    /// Cells.
    pub cells: Vec<CellRecord>,
    /// Grid lights.
    pub lights: Vec<GridLightRecord>,
    /// One for each of `lights`.
    pub octants: Vec<OctantsRecord>,
    /// Virtual lights.
    pub vpls: Vec<VplRecord>,
    /// One for each of `vpls`.
    pub points: Vec<[f32; 4]>,
    /// Blocks of `points`, then blocks of blocks.
    pub blocks: Vec<[f32; 8]>,
    /// Where each of `lights` comes from: its position in its level.
    pub origins: Vec<u32>,
}

impl GpuGrid {
    /// Copies a hierarchy to the device.
    ///
    /// Errors: more than the device can hold in one list
    pub fn upload(gpu: &Gpu, grid: &LightingGrid) -> Result<Self, Error> {
        let packed = PackedGrid::new(grid);
        Ok(Self {
            info: gpu.upload("grid levels", &[packed.info])?,
            cells: gpu.upload("grid cells", &packed.cells)?,
            lights: gpu.upload("grid lights", &packed.lights)?,
            octants: gpu.upload("octants of grid lights", &packed.octants)?,
            vpls: gpu.upload("sorted virtual lights", &packed.vpls)?,
            points: gpu.upload("points of virtual lights", &packed.points)?,
            blocks: gpu.upload("blocks of virtual lights", &packed.blocks)?,
        })
    }
}

impl PackedGrid {
    /// All levels in the order of the device.
    pub fn new(grid: &LightingGrid) -> Self {
        let mut packed = Self {
            vpls: grid.lights.iter().map(VplRecord::from).collect(),
            points: grid.points.clone(),
            ..Self::default()
        };
        for size in [BLOCK, SUPERBLOCK] {
            let shares = grid.points.chunks(size).map(share_of_points);
            packed.blocks.extend(shares.map(|share| share.map(|s| s as f32)));
        }
        for level in 1..=grid.levels.len() {
            packed.add_level(grid, level);
        }
        let level_count = grid.levels.len() as u32;
        packed.info.origin = grid.origin.to_array();
        packed.info.edge = grid.levels.last().map_or(0.0, |top| top.cell_size);
        packed.info.level_count = level_count;
        packed.info.vpl_count = grid.lights.len() as u32;
        packed.info.light_count = packed.lights.len() as u32;
        packed.info.cell_count = packed.cells.len() as u32;
        packed.info.levels[0].light_count = grid.level0.lights.len() as u32;
        packed
    }

    fn add_level(&mut self, grid: &LightingGrid, number: usize) {
        let level = &grid.levels[number - 1];
        let (first_cell, first_light) = (self.cells.len() as u32, self.lights.len() as u32);
        let inner_base = if number > 1 { self.info.levels[number - 1].first_cell } else { 0 };
        let record = |cell: &Cell| CellRecord {
            share: cell.share,
            inner: if number > 1 { inner_base + cell.inner } else { 0 },
            light: cell.light,
            octant_owned: cell.octant,
            ..CellRecord::default()
        };
        self.cells.extend(level.cells.iter().map(record));
        let cells = &mut self.cells[first_cell as usize..];
        place_cells(cells, grid, number);
        name_lobes(cells, level);

        let mut order: Vec<(u64, u32)> =
            level.octants.iter().map(Octants::first_corner).zip(0..).collect();
        // Lights of no cell have no share either.
        order.retain(|(corner, _)| *corner < u64::MAX);
        order.sort_unstable();
        let mut owners = vec![0u32; cells.len()];
        for &(corner, _) in &order {
            let cell = (corner / 8) as usize;
            cells[cell].octant_owned |= 1 << (8 + corner % 8);
            owners[cell] += 1;
        }
        let mut next = first_light;
        for (cell, owned) in cells.iter_mut().zip(owners) {
            cell.first_owned = next;
            next += owned;
        }
        for (_, index) in order {
            let octants = &level.octants[index as usize];
            self.lights.push(GridLightRecord::from(&level.lights[index as usize]));
            self.octants.push(OctantsRecord {
                luminance: octants.luminance,
                cells: octants.cells.map(|cell| first_cell + cell),
            });
            self.origins.push(index);
        }
        self.info.levels[number] = LevelInfo {
            first_cell,
            cell_count: level.cells.len() as u32 - 1,
            first_light,
            light_count: self.lights.len() as u32 - first_light,
        };
    }
}

/// Lattice coordinates of cells, from the first light in each.
fn place_cells(cells: &mut [CellRecord], grid: &LightingGrid, level: usize) {
    let scale = 1.0 / (1u32 << (level - 1)) as f32;
    let count = cells.len() - 1;
    for cell in &mut cells[..count] {
        let [x, y, z, _] = grid.points[cell.light as usize].map(|c| (c * scale) as u32);
        (cell.cell_xy, cell.cell_z_lobe) = (x | y << 16, z);
    }
}

/// Lobes of cells, from the lights around them.
fn name_lobes(cells: &mut [CellRecord], level: &Level) {
    for (light, octants) in level.lights.iter().zip(&level.octants) {
        for (cell, luminance) in octants.cells.iter().zip(octants.luminance) {
            if luminance > 0.0 {
                let record = &mut cells[*cell as usize];
                record.cell_z_lobe = record.cell_z_lobe & 0xffff | u32::from(light.lobe) << 16;
            }
        }
    }
}

impl From<&GridLight> for GridLightRecord {
    fn from(light: &GridLight) -> Self {
        let [x, y, z] = light.vertex.map(u32::from);
        Self {
            position: light.position.to_array(),
            luminance: light.luminance,
            intensity: light.intensity.to_array(),
            vertex_xy: x | y << 16,
            normal: light.normal.to_array(),
            vertex_z_lobe: z | u32::from(light.lobe) << 16,
            variance: light.variance.to_array(),
            _pad: 0,
        }
    }
}

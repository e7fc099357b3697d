//! The hierarchy as the graphics device holds it: all levels of a kind in one list.

use crate::error::Error;
use crate::gpu::{Buf, Gpu, record};
use crate::settings::MAX_LEVELS;
use crate::vlight::vpl::gpu::VplRecord;

/// Virtual lights per block of sums, and per block of blocks.
pub const BLOCK: usize = 32;
/// Virtual lights per block of blocks.
pub const SUPERBLOCK: usize = BLOCK * BLOCK;
/// Entries of the table of levels: 0 is that of the virtual lights themselves.
pub const LEVEL_ENTRIES: usize = MAX_LEVELS as usize + 2;

record! {
    /// Where one level lies in the lists.
    pub struct LevelInfo {
        /// Its first cell; level 0 has none.
        pub first_cell: u32,
        /// Its cells; one more follows as a sentinel.
        pub cell_count: u32,
        /// Its first grid light; level 0: 0, in the list of virtual lights.
        pub first_light: u32,
        /// Its grid lights; level 0: all virtual lights, 0 where gathering starts at level 1.
        pub light_count: u32,
    }
}

record! {
    /// The shape of the hierarchy, decided on the device.
    pub struct GridInfo {
        /// Lowest corner of the cube around the lights.
        pub origin: [f32; 3],
        /// Length of its edge, m.
        pub edge: f32,
        /// Levels; 0 without lights.
        pub level_count: u32,
        /// Virtual lights that take part.
        pub vpl_count: u32,
        /// Grid lights of all levels; those beyond the room for them are missing.
        pub light_count: u32,
        /// Cells of all levels, sentinels included; those beyond the room for them are missing.
        pub cell_count: u32,
        /// Where each level lies; entry 0 is that of the virtual lights themselves.
        pub levels: [LevelInfo; LEVEL_ENTRIES],
    }
}

record! {
    /// [`GridLight`](crate::gather::grid::GridLight) as shaders read it.
    pub struct GridLightRecord {
        /// Luminance-weighted mean position.
        pub position: [f32; 3],
        /// Luminance of `intensity`.
        pub luminance: f32,
        /// Sum of the shares' intensities, W·sr⁻¹.
        pub intensity: [f32; 3],
        /// Lattice coordinates x and y of the vertex, 16 bits each.
        pub vertex_xy: u32,
        /// Luminance-weighted mean of the unit normals.
        pub normal: [f32; 3],
        /// Lattice coordinate z and, above 16 bits, the lobe.
        pub vertex_z_lobe: u32,
        /// Per-axis variance of the position, m².
        pub variance: [f32; 3],
        /// Nothing.
        pub _pad: u32,
    }
}

record! {
    /// Where the share of a grid light lies: in the eight cells around its vertex; bit a of the
    /// index is set where the cell lies above the vertex along axis a.
    pub struct OctantsRecord {
        /// Luminance of the share in each cell.
        pub luminance: [f32; 8],
        /// Positions of the cells in the list of all levels; anything where the luminance is zero.
        pub cells: [u32; 8],
    }
}

record! {
    /// An occupied cell with the lights of one lobe. Cells of a level are sorted by (lobe, Morton
    /// code).
    pub struct CellRecord {
        /// Luminance shared to the corners of the coarser cell around it.
        pub share: [f32; 8],
        /// First of its cells in the level below, in the list of all levels; 0 in level 1.
        pub inner: u32,
        /// First of its virtual lights.
        pub light: u32,
        /// Which eighth of the coarser cell it is (bits 0–2), and which of its corners it owns
        /// (bits 8–15): those of whose cells it is the first.
        pub octant_owned: u32,
        /// Grid light of the first corner that it owns, in the list of all levels; the others
        /// follow, in the order of the corners.
        pub first_owned: u32,
        /// Lattice coordinates x and y of its lowest corner, 16 bits each.
        pub cell_xy: u32,
        /// Lattice coordinate z and, above 16 bits, the lobe.
        pub cell_z_lobe: u32,
        /// Nothing.
        pub _pad: [u32; 2],
    }
}

/// What a hierarchy has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridCapacity {
    /// Virtual lights.
    pub vpls: usize,
    /// Cells of all levels, and a sentinel for each level.
    pub cells: usize,
    /// Grid lights of all levels.
    pub lights: usize,
}

impl GridCapacity {
    /// What most sets of very many virtual lights need, as far as one list of the device holds it;
    /// smaller sets of fine scenes need more.
    pub fn for_vpls(gpu: &Gpu, vpls: usize) -> Self {
        let [most_cells, most_lights] = most_of(gpu);
        let cells = (vpls / 10 * 3 + 20_000).min(most_cells);
        let lights = (vpls / 25 * 18 + 40_000).min(most_lights);
        Self { vpls, cells, lights }
    }

    /// Room for what a build needed, with some to spare where one list of the device holds that;
    /// `None` where there was enough.
    pub fn grown(&self, gpu: &Gpu, info: &GridInfo) -> Option<Self> {
        let (cells, lights) = (info.cell_count as usize, info.light_count as usize);
        let [most_cells, most_lights] = most_of(gpu);
        let mut grown = *self;
        if cells > self.cells {
            grown.cells = (cells + cells / 8).min(most_cells).max(cells);
            // The lights were not counted: every cell has one of its own at least.
            grown.lights = (cells + cells / 4).min(most_lights).max(self.lights);
        } else if lights > self.lights {
            grown.lights = (lights + lights / 8).min(most_lights).max(lights);
        }
        (grown != *self).then_some(grown)
    }
}

/// Most cells and grid lights that one list of a device holds.
fn most_of(gpu: &Gpu) -> [usize; 2] {
    [size_of::<CellRecord>(), size_of::<GridLightRecord>()]
        .map(|record| gpu.max_list_bytes() as usize / record)
}

/// The hierarchy over one set of virtual lights, on the device.
///
/// The grid lights of a level follow each other by the first cell around their vertex, and by
/// corner where that is the same.
#[derive(Debug)]
pub struct GpuGrid {
    /// One record.
    pub info: Buf<GridInfo>,
    /// Cells of level 1, then of level 2, and so on; a sentinel ends each level.
    pub cells: Buf<CellRecord>,
    /// Grid lights of level 1, then of level 2, and so on.
    pub lights: Buf<GridLightRecord>,
    /// One for each of `lights`.
    pub octants: Buf<OctantsRecord>,
    /// The virtual lights that take part, sorted by lobe and Morton code of the finest cell.
    pub vpls: Buf<VplRecord>,
    /// Position in level-1 cells and luminance of each virtual light.
    pub points: Buf<[f32; 4]>,
    /// What each block of [`BLOCK`] virtual lights shares to the corners of their own level-1
    /// cells; from `blocks_of(vpls.len())` on, each block of [`SUPERBLOCK`] lights.
    pub blocks: Buf<[f32; 8]>,
}

/// Blocks of a number of virtual lights.
pub fn blocks_of(vpls: usize) -> usize {
    vpls.div_ceil(BLOCK)
}

impl GpuGrid {
    /// Room for a hierarchy.
    ///
    /// Errors: more than the device can hold in one list
    pub fn new(gpu: &Gpu, capacity: &GridCapacity) -> Result<Self, Error> {
        let GridCapacity { vpls, cells, lights } = *capacity;
        let blocks = blocks_of(vpls) + vpls.div_ceil(SUPERBLOCK);
        Ok(Self {
            info: gpu.buffer("grid levels", 1)?,
            cells: gpu.buffer("grid cells", cells)?,
            lights: gpu.buffer("grid lights", lights)?,
            octants: gpu.buffer("octants of grid lights", lights)?,
            vpls: gpu.buffer("sorted virtual lights", vpls)?,
            points: gpu.buffer("points of virtual lights", vpls)?,
            blocks: gpu.buffer("blocks of virtual lights", blocks)?,
        })
    }
}

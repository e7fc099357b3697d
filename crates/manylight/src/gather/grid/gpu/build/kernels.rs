//! The kernels of a build and what they are bound to, in the order in which they run.

use super::CELL_BLOCK;
use crate::gather::grid::build::LEFT_OUT;
use crate::gather::grid::gpu::RECORD_CONSTANTS;
use crate::gather::grid::gpu::record::{
    BLOCK, CellRecord, GridInfo, GridLightRecord, OctantsRecord, SUPERBLOCK,
};
use crate::gpu::{Constant, GROUP, MAX_GROUPS, Value, kernel, record};
use crate::settings::{MAX_LEVELS, MIN_LEVELS};
use crate::vlight::vpl::gpu::{VplInfo, VplRecord};

/// Virtual lights around a vertex beyond which a workgroup sums them up.
pub(super) const CROWDED: u32 = 512;
/// Invocations of such a workgroup.
const CROWDED_GROUP: u32 = 64;
/// Such workgroups; where there are more vertices they take several.
pub(super) const CROWDED_GROUPS: u32 = 1024;
/// Invocations of a workgroup that has eight for each grid light.
const OCTANT_GROUP: u32 = 128;

/// Most crowded vertices of a number of virtual lights: each lies in one cell, which has eight.
pub(super) fn most_crowded(vpls: usize) -> usize {
    8 * vpls / CROWDED as usize
}

const CONSTANTS: &[Constant] = &[
    Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) },
    Constant { name: "ITEM_GROUP", value: Value::U32(GROUP) },
    Constant { name: "OCTANT_GROUP", value: Value::U32(OCTANT_GROUP) },
    Constant { name: "MAX_LEVELS", value: Value::U32(MAX_LEVELS) },
    Constant { name: "MIN_LEVELS", value: Value::U32(MIN_LEVELS) },
    Constant { name: "LEFT_OUT", value: Value::U32(LEFT_OUT) },
    Constant { name: "CELL_BLOCK", value: Value::U32(CELL_BLOCK) },
    Constant { name: "BLOCK", value: Value::U32(BLOCK as u32) },
    Constant { name: "SUPERBLOCK", value: Value::U32(SUPERBLOCK as u32) },
    Constant { name: "CROWDED", value: Value::U32(CROWDED) },
    Constant { name: "NONE", value: Value::U32(u32::MAX) },
    Constant { name: "NEVER", value: Value::U32(u32::MAX) },
];

record! {
    /// Bounds of the lights, as words that sort like the numbers.
    pub(super) struct Extent {
        /// Low corner.
        pub low: [u32; 3],
        /// High corner.
        pub high: [u32; 3],
        /// Lights that take part.
        pub count: u32,
    }
}

record! {
    /// What keys need.
    pub(super) struct KeyParams {
        /// Grid lights per vertex, 1 or 6.
        pub lobes: u32,
    }
}

record! {
    /// What choosing levels needs.
    pub(super) struct ChooseParams {
        /// Levels; 0 leaves the choice to the device.
        pub levels: u32,
        /// Most levels that it chooses.
        pub level_cap: u32,
        /// Size below which a cell brings nothing, m.
        pub detail: f32,
        /// Level at which gathering starts.
        pub start_level: u32,
        /// Cells that there is room for.
        pub cell_capacity: u32,
    }
}

record! {
    /// What finding cells needs.
    pub(super) struct CellParams {
        /// Blocks of lights.
        pub blocks: u32,
    }
}

record! {
    /// What summing up blocks needs.
    pub(super) struct BlockParams {
        /// Where blocks of blocks begin in the list.
        pub first_superblock: u32,
        /// Whether they are what is summed up.
        pub is_super: u32,
    }
}

record! {
    /// What the shares of some levels need.
    pub(super) struct ShareParams {
        /// Finest of them.
        pub first_level: u32,
        /// Coarsest.
        pub last_level: u32,
        /// Where blocks of blocks begin in the list.
        pub first_superblock: u32,
    }
}

record! {
    /// What the grid lights of some levels need.
    pub(super) struct LevelParams {
        /// Finest of them.
        pub first_level: u32,
        /// Coarsest.
        pub last_level: u32,
    }
}

kernel! {
    /// Empties what is counted in.
    pub(super) struct Begin = "gather/grid/gpu/build/begin", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    shared vpl_info: VplInfo, write extent: Extent, write splits: u32, write sort_count: u32,
    write crowded: u32
}

kernel! {
    /// Bounds of the lights.
    pub(super) struct Bounds = "gather/grid/gpu/build/bounds", [GROUP, 1, 1], [CONSTANTS];
    shared vpl_info: VplInfo, read lights: VplRecord, write extent: Extent
}

kernel! {
    /// Sort keys.
    pub(super) struct Keys = "gather/grid/gpu/build/keys", [GROUP, 1, 1], [CONSTANTS];
    uniform params: KeyParams, shared vpl_info: VplInfo, read lights: VplRecord,
    write extent: Extent, write items: [u32; 4]
}

kernel! {
    /// Cells by number of levels.
    pub(super) struct Splits = "gather/grid/gpu/build/splits", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    write extent: Extent, read items: [u32; 4], write splits: u32
}

kernel! {
    /// The number of levels.
    pub(super) struct Choose = "gather/grid/gpu/build/choose", [1, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    uniform params: ChooseParams, write extent: Extent, write splits: u32,
    write info: GridInfo, write groups: [u32; 3]
}

kernel! {
    /// Cells per block of lights.
    pub(super) struct CellCounts = "gather/grid/gpu/build/cell_counts", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    uniform params: CellParams, shared info: GridInfo, read items: [u32; 4], write ranks: u32
}

kernel! {
    /// The cells.
    pub(super) struct CellWrite = "gather/grid/gpu/build/cell_write", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    uniform params: CellParams, shared info: GridInfo, read items: [u32; 4], read ranks: u32,
    write cells: CellRecord
}

kernel! {
    /// Virtual lights in order.
    pub(super) struct Copy = "gather/grid/gpu/build/copy", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    shared info: GridInfo, read lights: VplRecord, read items: [u32; 4], write vpls: VplRecord,
    write points: [f32; 4]
}

kernel! {
    /// Sums of blocks.
    pub(super) struct Blocks = "gather/grid/gpu/build/blocks", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    uniform params: BlockParams, shared info: GridInfo, read points: [f32; 4],
    write blocks: [f32; 8]
}

kernel! {
    /// Shares of the cells of some levels.
    pub(super) struct Share = "gather/grid/gpu/build/share", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    uniform params: ShareParams, shared info: GridInfo, read points: [f32; 4],
    read blocks: [f32; 8], write cells: CellRecord, write shares: [f32; 8]
}

kernel! {
    /// Empties the table of cells.
    pub(super) struct Clear = "gather/grid/gpu/build/clear", [GROUP, 1, 1], [CONSTANTS];
    write table: u32
}

kernel! {
    /// Fills the table of cells.
    pub(super) struct Insert = "gather/grid/gpu/build/insert", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    shared info: GridInfo, read cells: CellRecord, write table: u32
}

kernel! {
    /// Corners that each cell owns.
    pub(super) struct Own = "gather/grid/gpu/build/own", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    shared info: GridInfo, read table: u32, read shares: [f32; 8], write cells: CellRecord,
    write owned: u32
}

kernel! {
    /// Where the grid lights of each level lie.
    pub(super) struct Finish = "gather/grid/gpu/build/finish", [1, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    read owned: u32, read cells: CellRecord, read lights: GridLightRecord, write info: GridInfo,
    write groups: [u32; 3]
}

kernel! {
    /// The vertex of each grid light.
    pub(super) struct Place = "gather/grid/gpu/build/place", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    shared info: GridInfo, read table: u32, read owned: u32, write cells: CellRecord,
    write lights: GridLightRecord, write octants: OctantsRecord
}

kernel! {
    /// Grid lights of level 1.
    pub(super) struct SumVpls = "gather/grid/gpu/build/sum_vpls", [OCTANT_GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    shared info: GridInfo, read cells: CellRecord, read octants: OctantsRecord,
    read vpls: VplRecord, read points: [f32; 4], write lights: GridLightRecord,
    write crowded: u32
}

kernel! {
    /// Crowded grid lights of level 1.
    pub(super) struct SumCrowded = "gather/grid/gpu/build/sum_crowded", [CROWDED_GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    shared info: GridInfo, read cells: CellRecord, read octants: OctantsRecord,
    read vpls: VplRecord, read points: [f32; 4], write lights: GridLightRecord,
    read crowded: u32
}

kernel! {
    /// Grid lights of some levels.
    pub(super) struct SumLevel = "gather/grid/gpu/build/sum_level", [OCTANT_GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    uniform params: LevelParams, shared info: GridInfo, read cells: CellRecord,
    read octants: OctantsRecord, write lights: GridLightRecord
}

kernel! {
    /// Luminances around each vertex.
    pub(super) struct Octants = "gather/grid/gpu/build/octants", [OCTANT_GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    shared info: GridInfo, read shares: [f32; 8], write octants: OctantsRecord
}

/// Every kernel of a build.
#[cfg(test)]
pub(super) const KERNELS: &[&[&crate::gpu::KernelInfo]] = &[
    super::sort::KERNELS,
    &[
        &Begin::INFO,
        &Bounds::INFO,
        &Keys::INFO,
        &Splits::INFO,
        &Choose::INFO,
        &CellCounts::INFO,
        &CellWrite::INFO,
        &Copy::INFO,
        &Blocks::INFO,
        &Share::INFO,
        &Clear::INFO,
        &Insert::INFO,
        &Own::INFO,
        &Finish::INFO,
        &Place::INFO,
        &SumVpls::INFO,
        &SumCrowded::INFO,
        &SumLevel::INFO,
        &Octants::INFO,
    ],
];

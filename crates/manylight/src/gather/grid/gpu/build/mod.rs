//! Building the hierarchy on the device; twin of [`LightingGrid::build`](crate::gather::grid).
//!
//! In: [`GpuVpls`] · Out: [`GpuGrid`]
//! Keys → sort → number of levels → cells of all levels at once → which cell owns which vertex →
//! grid lights, from level to level. Sums run in a fixed order: the same bits on every run.
//! Limits: without room for all cells and lights there is no hierarchy, only how many there are.

mod kernels;
mod sort;

use super::record::{
    BLOCK, GpuGrid, GridCapacity, GridInfo, LEVEL_ENTRIES, LevelInfo, SUPERBLOCK, blocks_of,
};
use crate::error::Error;
use crate::gpu::scan::Scan;
use crate::gpu::{Buf, Kernel, Memory, Recorder};
use crate::settings::{GridSettings, MAX_LEVELS, MIN_LEVELS};
use crate::vlight::vpl::gpu::GpuVpls;
use kernels::*;
use sort::Sort;

/// Lights whose cells one workgroup counts.
const CELL_BLOCK: u32 = 1024;
/// Bits of a sort key: three for the lobe, above three a level.
const KEY_BITS: u32 = 3 * MAX_LEVELS;
/// Most grid lights of level 1 per virtual light, where the device chooses the levels.
const MOST_PER_VPL: u32 = 4;
/// Most cells and grid lights of a level that one workgroup sums up beside others.
const COARSE: u32 = 64;

/// How a hierarchy is built.
#[derive(Clone, Copy, Debug)]
pub struct GridRules {
    levels: Option<u32>,
    start_level: u32,
    lobes: u32,
    detail: f32,
    /// Most levels where the device chooses them; [`MAX_LEVELS`] unless
    /// [`GridRules::next_cap`] asked for less.
    pub level_cap: u32,
    /// Levels, from the finest, of which each is summed up by as many workgroups as it keeps busy;
    /// one workgroup goes through those above. For speed alone: see [`fine_levels`].
    pub fine_levels: u32,
}

impl GridRules {
    /// The rules of some settings; `detail` is the size below which a cell brings nothing, m.
    pub fn new(settings: &GridSettings, detail: f32) -> Self {
        let lobes = if settings.lobes == 1 { 1 } else { 6 };
        let GridSettings { levels, start_level, .. } = *settings;
        let (level_cap, fine_levels) = (MAX_LEVELS, MAX_LEVELS);
        Self { levels, start_level, lobes, detail, level_cap, fine_levels }
    }

    /// First and last level of each step of a sum that begins at some level.
    fn steps(&self, first: u32) -> impl Iterator<Item = (u32, u32)> + use<> {
        let coarse = (self.fine_levels + 1).clamp(first, MAX_LEVELS + 1);
        let rest = (coarse <= MAX_LEVELS).then_some((coarse, MAX_LEVELS));
        (first..coarse).map(|level| (level, level)).chain(rest)
    }

    /// The levels that a build should have had at most, where level 1 has too many lights: only a
    /// finished build can tell.
    pub fn next_cap(&self, info: &GridInfo) -> Option<u32> {
        let (levels, lights) = (info.level_count, info.levels[1].light_count);
        let too_many = lights > MOST_PER_VPL * info.vpl_count;
        (self.levels.is_none() && too_many && levels > MIN_LEVELS).then(|| levels - 1)
    }
}

/// The fine levels of builds like a finished one; see [`GridRules::fine_levels`]. All of them,
/// where it says nothing.
pub fn fine_levels(info: &GridInfo) -> u32 {
    let is_fine = |level: &LevelInfo| level.cell_count.max(level.light_count) > COARSE;
    let levels = (1..).zip(info.levels.iter().skip(1)).take(info.level_count as usize);
    match info.level_count {
        0 => MAX_LEVELS,
        _ => levels.filter(|(_, level)| is_fine(level)).map(|(l, _)| l).last().unwrap_or(0),
    }
}

/// Memory of builds, one after another.
#[derive(Debug)]
pub struct GridBuild {
    capacity: GridCapacity,
    extent: Buf<Extent>,
    splits: Buf<u32>,
    sort: Sort,
    sort_count: Buf<u32>,
    /// Cells that begin in each block of lights, by level.
    ranks: Buf<u32>,
    ranks_scan: Scan,
    /// Position of each cell in the list, by level and coordinates.
    table: Buf<u32>,
    /// Vertices that each cell owns, then those owned before it.
    owned: Buf<u32>,
    owned_scan: Scan,
    /// What each cell shares to its own corners.
    shares: Buf<[f32; 8]>,
    /// Workgroups over all cells, then over those of each level.
    cell_groups: Buf<[u32; 3]>,
    /// The same for the octants of grid lights.
    light_groups: Buf<[u32; 3]>,
    /// How many grid lights of level 1 are crowded, and which.
    crowded: Buf<u32>,
}

impl GridBuild {
    /// Memory for builds into a [`GpuGrid`] of the same capacity.
    ///
    /// Errors: more than the device can hold in one list
    pub fn new(memory: &impl Memory, capacity: GridCapacity) -> Result<Self, Error> {
        let gpu = memory.gpu();
        let blocks = capacity.vpls.div_ceil(CELL_BLOCK as usize);
        let ranks = blocks * MAX_LEVELS as usize;
        let table = (2 * capacity.cells).next_power_of_two();
        Ok(Self {
            capacity,
            extent: gpu.buffer("bounds of virtual lights", 1)?,
            splits: gpu.buffer("cells by number of levels", LEVEL_ENTRIES)?,
            sort: Sort::new(memory, capacity.vpls)?,
            sort_count: gpu.buffer("keys to sort", 1)?,
            ranks: memory.list("cells per block", ranks)?,
            ranks_scan: Scan::new(memory, ranks)?,
            table: memory.list("table of cells", table)?,
            owned: memory.list("vertices per cell", capacity.cells + 1)?,
            owned_scan: Scan::new(memory, capacity.cells + 1)?,
            shares: memory.list("shares of cells", capacity.cells)?,
            cell_groups: gpu.buffer("workgroups over cells", LEVEL_ENTRIES)?,
            light_groups: gpu.buffer("workgroups over grid lights", LEVEL_ENTRIES)?,
            crowded: memory.list("crowded grid lights", 1 + most_crowded(capacity.vpls))?,
        })
    }

    /// What there is room for.
    pub fn capacity(&self) -> &GridCapacity {
        &self.capacity
    }

    /// Builds the hierarchy of a set of virtual lights into `grid`.
    ///
    /// Cost: a sort of the lights, five reads of each cell, and the sums of the processor's build
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        vpls: &GpuVpls,
        rules: &GridRules,
        grid: &GpuGrid,
    ) {
        self.record_order(rec, vpls, rules, grid);
        self.record_cells(rec, grid);
        self.record_shares(rec, vpls, rules, grid);
        self.record_vertices(rec, grid);
        self.record_lights(rec, rules, grid);
    }

    /// The order of the lights and the number of levels.
    fn record_order(
        &self,
        rec: &mut Recorder<'_>,
        vpls: &GpuVpls,
        rules: &GridRules,
        grid: &GpuGrid,
    ) {
        let Self { extent, splits, sort, sort_count, cell_groups, crowded, .. } = self;
        let (vpl_info, lights, count) = (&vpls.info, &vpls.lights, vpls.lights.len());
        rec.dispatch(&Begin { vpl_info, extent, splits, sort_count, crowded }, [1, 1, 1]);
        rec.dispatch_items(&Bounds { vpl_info, lights, extent }, count);
        let params = rec.uniform(&KeyParams { lobes: rules.lobes });
        let items = &sort.items;
        rec.dispatch_items(&Keys { params, vpl_info, lights, extent, items }, count);
        sort.record(rec, sort_count, KEY_BITS);
        rec.dispatch_items(&Splits { extent, items, splits }, count);
        let params = rec.uniform(&ChooseParams {
            levels: rules.levels.unwrap_or(0),
            level_cap: rules.level_cap,
            detail: rules.detail,
            start_level: rules.start_level,
            cell_capacity: self.capacity.cells as u32,
        });
        let info = &grid.info;
        rec.dispatch(&Choose { params, extent, splits, info, groups: cell_groups }, [1, 1, 1]);
    }

    /// The cells of all levels.
    fn record_cells(&self, rec: &mut Recorder<'_>, grid: &GpuGrid) {
        let blocks = self.capacity.vpls.div_ceil(CELL_BLOCK as usize) as u32;
        let params = rec.uniform(&CellParams { blocks });
        let (items, ranks, info) = (&self.sort.items, &self.ranks, &grid.info);
        rec.dispatch(&CellCounts { params, info, items, ranks }, [blocks, 1, 1]);
        self.ranks_scan.record(rec, ranks, ranks.len());
        let cells = &grid.cells;
        rec.dispatch(&CellWrite { params, info, items, ranks, cells }, [blocks, 1, 1]);
    }

    /// The virtual lights in order, and what cells share to their corners.
    fn record_shares(
        &self,
        rec: &mut Recorder<'_>,
        from: &GpuVpls,
        rules: &GridRules,
        grid: &GpuGrid,
    ) {
        let GpuGrid { info, cells, vpls, points, blocks, .. } = grid;
        let items = &self.sort.items;
        let lights = &from.lights;
        rec.dispatch_items(&Copy { info, lights, items, vpls, points }, self.capacity.vpls);
        let first_superblock = blocks_of(self.capacity.vpls) as u32;
        for (is_super, size) in [(0, BLOCK), (1, SUPERBLOCK)] {
            let params = rec.uniform(&BlockParams { first_superblock, is_super });
            let count = self.capacity.vpls.div_ceil(size);
            rec.dispatch_items(&Blocks { params, info, points, blocks }, count);
        }
        for (first_level, last_level) in rules.steps(1) {
            let params = rec.uniform(&ShareParams { first_level, last_level, first_superblock });
            let share = Share { params, info, points, blocks, cells, shares: &self.shares };
            record_levels(rec, &share, &self.cell_groups, (first_level, last_level));
        }
    }

    /// Which cell owns which vertex, and the cells around each vertex.
    fn record_vertices(&self, rec: &mut Recorder<'_>, grid: &GpuGrid) {
        let Self { table, owned, shares, cell_groups, light_groups, .. } = self;
        let GpuGrid { info, cells, lights, octants, .. } = grid;
        rec.dispatch_items(&Clear { table }, table.len());
        rec.dispatch_indirect(&Insert { info, cells, table }, cell_groups, 0);
        rec.dispatch_items(&Own { info, table, shares, cells, owned }, owned.len());
        self.owned_scan.record(rec, owned, owned.len());
        rec.dispatch(&Finish { owned, cells, lights, info, groups: light_groups }, [1, 1, 1]);
        let place = Place { info, table, owned, cells, lights, octants };
        rec.dispatch_indirect(&place, cell_groups, 0);
    }

    /// The grid lights, from level to level.
    fn record_lights(&self, rec: &mut Recorder<'_>, rules: &GridRules, grid: &GpuGrid) {
        let GpuGrid { info, cells, lights, octants, vpls, points, .. } = grid;
        let Self { light_groups: groups, crowded, .. } = self;
        let sum = SumVpls { info, cells, octants, vpls, points, lights, crowded };
        rec.dispatch_indirect(&sum, groups, 1);
        let sum = SumCrowded { info, cells, octants, vpls, points, lights, crowded };
        rec.dispatch(&sum, [CROWDED_GROUPS.min(crowded.len() as u32 - 1), 1, 1]);
        for (first_level, last_level) in rules.steps(2) {
            let params = rec.uniform(&LevelParams { first_level, last_level });
            let sum = SumLevel { params, info, cells, octants, lights };
            record_levels(rec, &sum, groups, (first_level, last_level));
        }
        rec.dispatch_indirect(&Octants { info, shares: &self.shares, octants }, groups, 0);
    }
}

/// One level by as many workgroups as were counted for it, more by a single one.
fn record_levels<K: Kernel>(
    rec: &mut Recorder<'_>,
    kernel: &K,
    groups: &Buf<[u32; 3]>,
    (first, last): (u32, u32),
) {
    match first == last {
        true => rec.dispatch_indirect(kernel, groups, first as usize),
        false => rec.dispatch(kernel, [1; 3]),
    }
}

#[cfg(test)]
mod tests;

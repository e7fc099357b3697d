//! Gathering on the device: bands of blocks, and in each the steps of `sample.rs`.
//!
//! Search (twice: count and keep, then write) → light → for each slice of rays: pick → target →
//! shadow → resolve. Nothing is read back: what there was no room for is told in
//! [`GatherOut::stats`].

use super::RECORD_CONSTANTS;
use super::alpha::Alpha;
use super::capacity::{GatherCapacity, blocks_of};
use super::params::{
    BLOCK_PIXELS, CHUNK, CONSTANTS, GatherParams, GatherStats, Pick, Reach, SEARCH_GROUP,
    TILE_PIXELS, TILES,
};
use super::record::{CellRecord, GpuGrid, GridInfo, GridLightRecord, OctantsRecord};
use crate::error::Error;
use crate::gather::grid::TILE;
use crate::gpu::scan::Scan;
use crate::gpu::{Buf, Gpu, Memory, Recorder, kernel};
use crate::settings::{Settings, ShadowTarget};
use crate::surface::gpu::{CONSTANTS as SURFACE_CONSTANTS, GpuReceivers};
use crate::vlight::vpl::gpu::VplRecord;
use crate::{bvh, shadow, world};

const GROUP: u32 = TILE_PIXELS as u32;

kernel! {
    /// Finds the lights that can reach a block.
    struct Search = "gather/grid/gpu/search", [SEARCH_GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS, SURFACE_CONSTANTS];
    uniform params: GatherParams, shared reach: Reach, shared info: GridInfo,
    read positions: [f32; 4], read normals: [f32; 4], read cells: CellRecord,
    read lights: GridLightRecord, read vpls: VplRecord, write frontier: u32,
    write candidates: u32, write stats: GatherStats
}

kernel! {
    /// Sums up the lights of a tile.
    struct Light = "gather/grid/gpu/light", [TILE as u32, TILE as u32, 1],
        [CONSTANTS, RECORD_CONSTANTS, SURFACE_CONSTANTS];
    uniform params: GatherParams, shared reach: Reach, shared info: GridInfo,
    read positions: [f32; 4], read normals: [f32; 4], read candidates: u32,
    read lights: GridLightRecord, read vpls: VplRecord, write masks: [u32; 2],
    write weights: f32, write unshadowed: [f32; 4]
}

kernel! {
    /// Draws a light per ray.
    struct PickLights = "gather/grid/gpu/pick", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS, SURFACE_CONSTANTS];
    uniform params: GatherParams, shared reach: Reach, shared info: GridInfo,
    read positions: [f32; 4], read normals: [f32; 4], read candidates: u32,
    read masks: [u32; 2], read weights: f32, read lights: GridLightRecord,
    read vpls: VplRecord, write picks: Pick
}

kernel! {
    /// Draws a virtual light in every picked light.
    struct Target = "gather/grid/gpu/target", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS, SURFACE_CONSTANTS];
    uniform params: GatherParams, shared info: GridInfo, write picks: Pick,
    read positions: [f32; 4], read normals: [f32; 4], read cells: CellRecord,
    read octants: OctantsRecord, read vpls: VplRecord, read points: [f32; 4],
    read blocks: [f32; 8]
}

kernel! {
    /// Draws a point in the spread of every picked light.
    struct Cloud = "gather/grid/gpu/cloud", [GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS, SURFACE_CONSTANTS];
    uniform params: GatherParams, shared info: GridInfo, write picks: Pick,
    read lights: GridLightRecord, read vpls: VplRecord, write targets: [f32; 4]
}

kernel! {
    /// Traces rays to virtual lights.
    struct Shadow = "gather/grid/gpu/shadow", [GROUP, 1, 1], scene,
        [CONSTANTS, SURFACE_CONSTANTS, shadow::gpu::CONSTANTS, world::gpu::CONSTANTS,
         bvh::gpu::CONSTANTS];
    uniform params: GatherParams, write picks: Pick, read positions: [f32; 4],
    read normals: [f32; 4], read vpls: VplRecord
}

kernel! {
    /// Traces rays to points in space.
    struct ShadowPoint = "gather/grid/gpu/shadow_point", [GROUP, 1, 1], scene,
        [CONSTANTS, SURFACE_CONSTANTS, shadow::gpu::CONSTANTS, world::gpu::CONSTANTS,
         bvh::gpu::CONSTANTS];
    uniform params: GatherParams, write picks: Pick, read positions: [f32; 4],
    read normals: [f32; 4], read targets: [f32; 4]
}

kernel! {
    /// Turns rays into ratios.
    struct Resolve = "gather/grid/gpu/resolve", [GROUP, 1, 1], [CONSTANTS, SURFACE_CONSTANTS];
    uniform params: GatherParams, read positions: [f32; 4], read candidates: u32,
    read picks: Pick, write ratio: [f32; 2], write stats: GatherStats
}

/// Every kernel of this file.
#[cfg(test)]
pub(super) const KERNELS: &[&crate::gpu::KernelInfo] = &[
    &Search::INFO,
    &Light::INFO,
    &PickLights::INFO,
    &Target::INFO,
    &Cloud::INFO,
    &Shadow::INFO,
    &ShadowPoint::INFO,
    &Resolve::INFO,
];

/// What a gather gives; see [`Gathered`](crate::gather::Gathered).
///
/// Shapes: `[height · width]`, row-major from the top
#[derive(Debug)]
pub struct GatherOut {
    /// Irradiance without visibility, W·m⁻², and the number of lights evaluated.
    pub unshadowed: Buf<[f32; 4]>,
    /// Share of it that arrives, 0…1, and its trust; 1 where there is nothing to share.
    pub ratio: Buf<[f32; 2]>,
    /// One record: how far the levels reach.
    pub reach: Buf<Reach>,
    /// One record: what there should have been room for.
    pub stats: Buf<GatherStats>,
}

impl GatherOut {
    /// Room for the irradiance of a picture.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(gpu: &Gpu, width: usize, height: usize) -> Result<Self, Error> {
        let pixels = width * height;
        Ok(Self {
            unshadowed: gpu.buffer("unshadowed sums", pixels)?,
            ratio: gpu.buffer("shadow ratios", pixels)?,
            reach: gpu.buffer("reach of levels", 1)?,
            stats: gpu.buffer("needs of a gather", 1)?,
        })
    }
}

/// Everything that a gather works on.
#[derive(Clone, Copy, Debug)]
pub struct GatherInput<'a> {
    /// The picture's receivers.
    pub receivers: &'a GpuReceivers,
    /// Lights.
    pub grid: &'a GpuGrid,
    /// How to gather.
    pub settings: &'a Settings,
    /// Distance below which a light stops growing, m.
    pub d_min: f32,
    /// Chooses the draws.
    pub seed: u32,
}

/// Memory of gathers, one after another.
#[derive(Debug)]
pub struct Gather {
    width: usize,
    height: usize,
    capacity: GatherCapacity,
    alpha: Alpha,
    scan: Scan,
    /// Cells to look into, two sides per block; then the lights that each block found.
    frontier: Buf<u32>,
    /// Where those begin, and how many a block has room for.
    kept: [usize; 2],
    /// First chunk of each block and of none, then the lights of all chunks.
    pub(super) candidates: Buf<u32>,
    /// Which lights of a chunk reach each tile of its block.
    pub(super) masks: Buf<[u32; 2]>,
    /// Running shadow weight of each receiver of its block after a chunk; in the memory of
    /// `frontier`.
    pub(super) weights: Buf<f32>,
    /// Draws of a slice of rays.
    pub(super) picks: Buf<Pick>,
    /// Points that they aim at, where those are no virtual lights.
    pub(super) targets: Buf<[f32; 4]>,
}

impl Gather {
    /// Memory for gathers of pictures of one size with some settings.
    ///
    /// Errors: more than the device can hold
    pub fn new(
        memory: &impl Memory,
        width: usize,
        height: usize,
        settings: &Settings,
        capacity: GatherCapacity,
    ) -> Result<Self, Error> {
        let capacity = capacity.fit(memory.gpu(), width, height, settings);
        let (blocks, chunks) = (capacity.band_blocks as usize, capacity.chunks() as usize);
        let rays = blocks * BLOCK_PIXELS * capacity.slice_rays as usize;
        let has_points = settings.shadow.target == ShadowTarget::Variance;
        let [words, kept @ ..] = capacity.search(memory.gpu());
        let frontier = memory.list::<u32>("search of blocks", words)?;
        Ok(Self {
            width,
            height,
            capacity,
            alpha: Alpha::new(memory, width * height)?,
            scan: Scan::new(memory, blocks + 1)?,
            weights: frontier.reused("running weights", chunks * BLOCK_PIXELS),
            frontier,
            kept,
            candidates: memory.list("lights near blocks", blocks + 1 + chunks * CHUNK)?,
            masks: memory.list("lights near tiles", chunks * TILES)?,
            picks: memory.list("drawn lights", rays)?,
            targets: memory.list("drawn points", if has_points { rays } else { 0 })?,
        })
    }

    /// What there is room for.
    pub fn capacity(&self) -> &GatherCapacity {
        &self.capacity
    }

    /// Gathers; kernels that trace rays need the recorder's scene.
    ///
    /// Panics: for receivers of another size, or targets in space where `new` had none
    pub fn record(&self, rec: &mut Recorder<'_>, input: &GatherInput<'_>, out: &GatherOut) {
        let params = self.start(rec, input, out);
        for band in self.bands(&params) {
            self.record_light(rec, input, &band, out);
            for slice in self.slices(&band) {
                self.record_picks(rec, input, &slice, out);
                self.record_targets(rec, input, &slice);
                self.record_shadows(rec, input, &slice);
                self.record_ratio(rec, input, &slice, out);
            }
        }
    }

    /// Alpha, and empty statistics.
    pub(super) fn start(
        &self,
        rec: &mut Recorder<'_>,
        input: &GatherInput<'_>,
        out: &GatherOut,
    ) -> GatherParams {
        let GatherInput { receivers, grid, settings, d_min, seed } = *input;
        assert!(receivers.width == self.width && receivers.height == self.height, "other pixels");
        let params = GatherParams {
            width: self.width as u32,
            height: self.height as u32,
            blocks_x: blocks_of(self.width, self.height, settings.interleave as usize)[0] as u32,
            frontier_capacity: self.capacity.frontier,
            chunk_capacity: self.capacity.chunks(),
            list_start: self.capacity.band_blocks + 1,
            kept_start: self.kept[0] as u32,
            kept_capacity: self.kept[1] as u32,
            ..GatherParams::new(settings, d_min, seed)
        };
        rec.stage("gather alpha");
        let lists = (&self.frontier, &out.stats, &out.reach);
        self.alpha.record(rec, &params, receivers, grid, settings, lists);
        params
    }

    /// The bands of the picture.
    pub(super) fn bands(&self, params: &GatherParams) -> Vec<GatherParams> {
        let [x, y] = blocks_of(self.width, self.height, params.side as usize);
        let (all, most) = ((x * y) as u32, self.capacity.band_blocks);
        let band = |first_block: u32| {
            let block_count = most.min(all - first_block);
            GatherParams { first_block, block_count, ..*params }
        };
        (0..all).step_by(most as usize).map(band).collect()
    }

    /// The slices of a band's rays; one without rays.
    pub(super) fn slices(&self, band: &GatherParams) -> Vec<GatherParams> {
        let most = self.capacity.slice_rays;
        let slice = |first_ray: u32| {
            let slice_rays = most.min(band.rays - first_ray);
            GatherParams { first_ray, slice_rays, ..*band }
        };
        (0..band.rays.max(1)).step_by(most as usize).map(slice).collect()
    }

    /// The lights near a band's blocks, and their sums.
    pub(super) fn record_light(
        &self,
        rec: &mut Recorder<'_>,
        input: &GatherInput<'_>,
        band: &GatherParams,
        out: &GatherOut,
    ) {
        let GpuReceivers { positions, normals, .. } = input.receivers;
        let GpuGrid { info, cells, lights, vpls, .. } = input.grid;
        let Self { frontier, candidates, masks, weights, .. } = self;
        let (reach, stats) = (&out.reach, &out.stats);
        rec.stage("gather search");
        for is_writing in [0, 1] {
            let params = rec.uniform(&GatherParams { is_writing, ..*band });
            rec.dispatch(
                &Search {
                    params,
                    reach,
                    info,
                    positions,
                    normals,
                    cells,
                    lights,
                    vpls,
                    frontier,
                    candidates,
                    stats,
                },
                [band.block_count, 1, 1],
            );
            if is_writing == 0 {
                self.scan.record(rec, candidates, band.block_count as usize + 1);
            }
        }
        rec.stage("gather light");
        let params = rec.uniform(band);
        let unshadowed = &out.unshadowed;
        rec.dispatch(
            &Light {
                params,
                reach,
                info,
                positions,
                normals,
                candidates,
                lights,
                vpls,
                masks,
                weights,
                unshadowed,
            },
            [band.block_count * TILES as u32, 1, 1],
        );
    }

    /// Draws lights for a slice of rays.
    pub(super) fn record_picks(
        &self,
        rec: &mut Recorder<'_>,
        input: &GatherInput<'_>,
        slice: &GatherParams,
        out: &GatherOut,
    ) {
        let GpuReceivers { positions, normals, .. } = input.receivers;
        let GpuGrid { info, lights, vpls, .. } = input.grid;
        let Self { candidates, masks, weights, picks, .. } = self;
        let (params, reach) = (rec.uniform(slice), &out.reach);
        rec.stage("gather pick");
        rec.dispatch(
            &PickLights {
                params,
                reach,
                info,
                positions,
                normals,
                candidates,
                masks,
                weights,
                lights,
                vpls,
                picks,
            },
            groups_of(slice),
        );
    }

    /// Draws what each ray aims at in the picked lights.
    pub(super) fn record_targets(
        &self,
        rec: &mut Recorder<'_>,
        input: &GatherInput<'_>,
        slice: &GatherParams,
    ) {
        let GpuReceivers { positions, normals, .. } = input.receivers;
        let GpuGrid { info, lights, cells, octants, vpls, points, blocks } = input.grid;
        let Self { picks, targets, .. } = self;
        let params = rec.uniform(slice);
        rec.stage("gather target");
        match input.settings.shadow.target {
            ShadowTarget::Vpl => rec.dispatch(
                &Target {
                    params,
                    info,
                    picks,
                    positions,
                    normals,
                    cells,
                    octants,
                    vpls,
                    points,
                    blocks,
                },
                groups_of(slice),
            ),
            ShadowTarget::Variance => {
                assert!(targets.len() >= picks.len(), "no room for targets in space");
                let cloud = Cloud { params, info, picks, lights, vpls, targets };
                rec.dispatch(&cloud, groups_of(slice));
            }
        }
    }

    /// Traces the rays of a slice.
    pub(super) fn record_shadows(
        &self,
        rec: &mut Recorder<'_>,
        input: &GatherInput<'_>,
        slice: &GatherParams,
    ) {
        let GpuReceivers { positions, normals, .. } = input.receivers;
        let (picks, targets, vpls) = (&self.picks, &self.targets, &input.grid.vpls);
        let params = rec.uniform(slice);
        rec.stage("gather shadow");
        match input.settings.shadow.target {
            ShadowTarget::Vpl => {
                rec.dispatch(&Shadow { params, picks, positions, normals, vpls }, groups_of(slice))
            }
            ShadowTarget::Variance => rec.dispatch(
                &ShadowPoint { params, picks, positions, normals, targets },
                groups_of(slice),
            ),
        }
    }

    /// Adds the rays of a slice to the ratios, and finishes them with the last.
    pub(super) fn record_ratio(
        &self,
        rec: &mut Recorder<'_>,
        input: &GatherInput<'_>,
        slice: &GatherParams,
        out: &GatherOut,
    ) {
        let positions = &input.receivers.positions;
        let Self { candidates, picks, .. } = self;
        let (ratio, stats) = (&out.ratio, &out.stats);
        let params = rec.uniform(slice);
        rec.stage("gather ratio");
        rec.dispatch(
            &Resolve { params, positions, candidates, picks, ratio, stats },
            [slice.block_count * TILES as u32, 1, 1],
        );
    }
}

/// A workgroup per tile and ray.
fn groups_of(slice: &GatherParams) -> [u32; 3] {
    [slice.block_count * TILES as u32, slice.slice_rays, 1]
}

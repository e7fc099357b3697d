//! The alpha at which a receiver evaluates as many lights as asked, chosen on the device; see
//! `reach.rs`.

use super::RECORD_CONSTANTS;
use super::params::{CONSTANTS, GatherParams, GatherStats, RUN, Reach, SEARCH_GROUP};
use super::record::{CellRecord, GpuGrid, GridInfo, GridLightRecord};
use crate::error::Error;
use crate::gather::grid::reach::{ASKED, STEPS, asked_share};
use crate::gpu::scan::Scan;
use crate::gpu::{Buf, Memory, Recorder, kernel, record};
use crate::settings::Settings;
use crate::surface::gpu::{CONSTANTS as SURFACE_CONSTANTS, GpuReceivers};
use crate::vlight::vpl::gpu::VplRecord;

record! {
    /// The pixels to ask among.
    struct AskParams {
        /// Pixels of the picture.
        pixels: u32,
        /// Runs of pixels.
        runs: u32,
    }
}

record! {
    /// What to aim at.
    struct Wanted {
        /// Lights that a receiver should evaluate.
        evals: u32,
    }
}

kernel! {
    /// Sets alpha, and empties the statistics.
    struct AlphaStart = "gather/grid/gpu/alpha_start", [32, 1, 1];
    uniform start: Reach, write reach: Reach, write stats: GatherStats
}

kernel! {
    /// Counts receivers in runs of pixels.
    struct AlphaRuns = "gather/grid/gpu/alpha_runs", [RUN, 1, 1], [CONSTANTS, SURFACE_CONSTANTS];
    uniform params: AskParams, read positions: [f32; 4], write runs: u32
}

kernel! {
    /// Picks the receivers to ask.
    struct AlphaAsk = "gather/grid/gpu/alpha_ask", [ASKED as u32, 1, 1],
        [CONSTANTS, SURFACE_CONSTANTS];
    uniform params: AskParams, read positions: [f32; 4], read normals: [f32; 4], read runs: u32,
    read shares: [u32; 2], write asked: [f32; 4], write reach: Reach
}

kernel! {
    /// Counts their lights.
    struct AlphaCount = "gather/grid/gpu/alpha_count", [SEARCH_GROUP, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    uniform params: GatherParams, shared reach: Reach, shared info: GridInfo,
    read asked: [f32; 4], read cells: CellRecord, read lights: GridLightRecord,
    read vpls: VplRecord, write frontier: u32, write counts: u32, write stats: GatherStats
}

kernel! {
    /// Corrects alpha.
    struct AlphaAdjust = "gather/grid/gpu/alpha_adjust", [ASKED as u32, 1, 1],
        [CONSTANTS, RECORD_CONSTANTS];
    uniform wanted: Wanted, shared info: GridInfo, read counts: u32, write reach: Reach
}

/// Every kernel of this file.
#[cfg(test)]
pub(super) const KERNELS: &[&crate::gpu::KernelInfo] =
    &[&AlphaStart::INFO, &AlphaRuns::INFO, &AlphaAsk::INFO, &AlphaCount::INFO, &AlphaAdjust::INFO];

/// Memory for choosing alpha.
#[derive(Debug)]
pub(super) struct Alpha {
    /// Receivers before each run of pixels.
    runs: Buf<u32>,
    scan: Scan,
    /// Where the receivers that are asked lie among all: upper and lower word of a fraction.
    shares: Buf<[u32; 2]>,
    /// Their positions, then their normals.
    asked: Buf<[f32; 4]>,
    /// Their lights.
    counts: Buf<u32>,
}

impl Alpha {
    pub fn new(memory: &impl Memory, pixels: usize) -> Result<Self, Error> {
        let gpu = memory.gpu();
        let runs = pixels.div_ceil(RUN as usize);
        let words = |i: usize| {
            let scaled = asked_share(i) * 2f64.powi(32);
            [scaled as u32, (scaled.fract() * 2f64.powi(32)) as u32]
        };
        Ok(Self {
            runs: memory.list("receivers by run of pixels", runs + 1)?,
            scan: Scan::new(memory, runs + 1)?,
            shares: gpu
                .upload("shares of asked receivers", &(0..ASKED).map(words).collect::<Vec<_>>())?,
            asked: gpu.buffer("asked receivers", 2 * ASKED)?,
            counts: gpu.buffer("lights of asked receivers", ASKED)?,
        })
    }

    /// Chooses alpha; `frontier` has room for each receiver that is asked.
    pub fn record(
        &self,
        rec: &mut Recorder<'_>,
        params: &GatherParams,
        receivers: &GpuReceivers,
        grid: &GpuGrid,
        settings: &Settings,
        (frontier, stats, reach): (&Buf<u32>, &Buf<GatherStats>, &Buf<Reach>),
    ) {
        let fixed = settings.grid.alpha;
        let start = Reach {
            alpha: fixed.unwrap_or(1.0),
            is_done: u32::from(fixed.is_some()),
            ..Reach::default()
        };
        let start = rec.uniform(&start);
        rec.dispatch(&AlphaStart { start, reach, stats }, [1; 3]);
        if fixed.is_some() {
            return;
        }
        let pixels = receivers.width * receivers.height;
        let runs = pixels.div_ceil(RUN as usize);
        let ask = rec.uniform(&AskParams { pixels: pixels as u32, runs: runs as u32 });
        let (positions, normals) = (&receivers.positions, &receivers.normals);
        let count = AlphaRuns { params: ask, positions, runs: &self.runs };
        rec.dispatch_items(&count, (runs + 1) * RUN as usize);
        self.scan.record(rec, &self.runs, runs + 1);
        let Self { runs, shares, asked, counts, .. } = self;
        rec.dispatch(
            &AlphaAsk { params: ask, positions, normals, runs, shares, asked, reach },
            [1; 3],
        );
        let params = rec.uniform(params);
        let wanted = rec.uniform(&Wanted { evals: settings.grid.evals });
        let GpuGrid { info, cells, lights, vpls, .. } = grid;
        for _ in 0..STEPS {
            rec.dispatch(
                &AlphaCount {
                    params,
                    reach,
                    info,
                    asked,
                    cells,
                    lights,
                    vpls,
                    frontier,
                    counts,
                    stats,
                },
                [ASKED as u32, 1, 1],
            );
            rec.dispatch(&AlphaAdjust { wanted, info, counts, reach }, [1; 3]);
        }
    }
}

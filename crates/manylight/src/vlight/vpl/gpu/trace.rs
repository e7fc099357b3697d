//! Random walks on the device, in rounds whose size it decides by itself.
//!
//! Every round traces a batch of paths into slots, sums up their lights, appends those of the
//! paths that belong to the set, and chooses the next batch by what the last ones found. The set
//! is the same whatever the batches are: path j draws from (seed, j, dimension) alone.

use super::{GpuVpls, VplInfo, VplRecord};
use crate::error::Error;
use crate::gpu::scan::Scan;
use crate::gpu::{
    Buf, Constant, GROUP, MAX_GROUPS, Memory, Recorder, Uniform, Value, kernel, record,
};
use crate::vlight::vpl::trace::{BATCH, MAX_NORMAL_CORRECTION, PATHS_PER_LIGHT};
use crate::{bvh, emitter, world};

/// Fewest and most lights that a batch has slots for; the most are 48 MiB.
const SLOTS: [u32; 2] = [1 << 16, 1 << 20];
/// Paths per light that the recorded rounds are enough for, at least.
const EXPECTED_PATHS_PER_LIGHT: u32 = 3;
/// Paths per workgroup: few, since their lengths differ.
const PATH_GROUP: u32 = 64;

const CONSTANTS: &[Constant] = &[
    Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) },
    Constant { name: "MAX_NORMAL_CORRECTION", value: Value::F32(MAX_NORMAL_CORRECTION) },
    Constant { name: "PATH_GROUP", value: Value::U32(PATH_GROUP) },
    Constant { name: "FIRST_BATCH", value: Value::U32(1024) },
];

record! {
    /// What [`TracePaths`] needs to know.
    struct PathParams {
        /// Of the sequence whose points are paths.
        seed: u32,
        /// Most lights to a path.
        bounces: u32,
        /// 1: normal textures bend normals.
        normal_maps: u32,
    }
}

record! {
    /// Where tracing stands.
    struct TraceState {
        /// Lights of the set so far.
        light_count: u32,
        /// Paths of the set so far.
        path_count: u32,
        /// Paths of the batch under way.
        batch: u32,
    }
}

record! {
    /// What [`Advance`] needs to know.
    struct AdvanceParams {
        /// Lights wanted.
        count: u32,
        /// Most paths of a batch.
        capacity: u32,
        /// Paths after which to give up.
        limit: u32,
        /// 1: nothing was traced before.
        first: u32,
    }
}

record! {
    /// What [`Append`] needs to know.
    struct AppendParams {
        /// Lights wanted.
        count: u32,
        /// Slots to a path.
        bounces: u32,
    }
}

kernel! {
    /// Traces the paths of a batch.
    struct TracePaths = "vlight/vpl/gpu/trace_paths", [PATH_GROUP, 1, 1], scene,
        [CONSTANTS, emitter::gpu::CONSTANTS, world::gpu::CONSTANTS, bvh::gpu::CONSTANTS];
    uniform params: PathParams, shared state: TraceState, write slots: VplRecord,
    write counts: u32
}

kernel! {
    /// Counts the last batch and decides on the next.
    struct Advance = "vlight/vpl/gpu/advance", [1, 1, 1], [CONSTANTS];
    uniform params: AdvanceParams, read offsets: u32, write state: TraceState,
    write info: VplInfo, write groups: [u32; 3]
}

kernel! {
    /// Appends the lights of a batch.
    struct Append = "vlight/vpl/gpu/append", [PATH_GROUP, 1, 1], [CONSTANTS];
    uniform params: AppendParams, shared state: TraceState, read offsets: u32,
    read slots: VplRecord, write lights: VplRecord
}

kernel! {
    /// Divides by the number of paths.
    struct Scale = "vlight/vpl/gpu/scale", [GROUP, 1, 1], [CONSTANTS];
    shared info: VplInfo, write lights: VplRecord
}

/// Every kernel of this file.
#[cfg(test)]
pub(super) const KERNELS: &[&crate::gpu::KernelInfo] =
    &[&TracePaths::INFO, &Advance::INFO, &Append::INFO, &Scale::INFO];

/// Traces sets of one size.
#[derive(Debug)]
pub struct VplTracer {
    count: u32,
    bounces: u32,
    /// Most paths of a round.
    batch: u32,
    /// Rounds that are recorded.
    rounds: u32,
    /// How many of them before a set has told.
    first_rounds: u32,
    /// Most that a set of these lights has taken; 0: none has told.
    most_taken: u32,
    /// Most that any set has taken.
    most_ever: u32,
    /// Whether rounds were once too few, so that no set is taken at its word.
    has_lacked: bool,
    slots: Buf<VplRecord>,
    /// Lights of each path of a batch, then lights before each.
    offsets: Buf<u32>,
    scan: Scan,
    state: Buf<TraceState>,
    groups: Buf<[u32; 3]>,
}

impl VplTracer {
    /// Memory for tracing about `count` lights, at most `bounces` to a path.
    ///
    /// Errors: more than the device can hold in one list
    pub fn new(memory: &impl Memory, count: u32, bounces: u32) -> Result<Self, Error> {
        let slots = count.saturating_mul(2).clamp(SLOTS[0], SLOTS[1]);
        Self::with_batch(memory, count, bounces, (slots / bounces.max(1)).max(1))
    }

    /// The same with a batch of another size.
    pub(super) fn with_batch(
        memory: &impl Memory,
        count: u32,
        bounces: u32,
        batch: u32,
    ) -> Result<Self, Error> {
        let expected = u64::from(count) * u64::from(EXPECTED_PATHS_PER_LIGHT);
        // A small first one, those expected, and one for what they miss by chance.
        let rounds = 2 + expected.min(path_limit(count)).div_ceil(batch.into()) as u32;
        Ok(Self {
            count,
            bounces,
            batch,
            rounds,
            first_rounds: rounds,
            most_taken: 0,
            most_ever: 0,
            has_lacked: false,
            slots: memory.list("virtual lights of a batch", (batch * bounces) as usize)?,
            offsets: memory.list("virtual lights per path", batch as usize + 1)?,
            scan: Scan::new(memory, batch as usize + 1)?,
            state: memory.gpu().buffer("progress of light paths", 1)?,
            groups: memory.gpu().buffer("workgroups of light paths", 1)?,
        })
    }

    /// Rounds that are recorded; one without anything left to do still costs its dispatches.
    pub fn rounds(&self) -> u32 {
        self.rounds
    }

    /// Rounds that the longest set of these lights took, and the longest of all, as far as
    /// [`VplTracer::learn_rounds`] was told.
    pub fn most_taken(&self) -> [u32; 2] {
        [self.most_taken, self.most_ever]
    }

    /// A set took some rounds: as many as the longest set of these lights took from now on, and
    /// some for what the next misses by chance; no fewer than at first if those were once too few.
    pub fn learn_rounds(&mut self, taken: u32) {
        self.most_taken = self.most_taken.max(taken);
        self.recall_rounds(self.most_taken);
        if !self.has_lacked {
            self.set_rounds((self.most_taken + self.most_taken / 8).saturating_add(1));
        }
    }

    /// Sets of other lights took some rounds.
    pub fn recall_rounds(&mut self, taken: u32) {
        self.most_ever = self.most_ever.max(taken);
    }

    /// The light, or what it meets, is another: twice as many rounds as any set took, but no more
    /// than before any set.
    pub fn doubt_rounds(&mut self) {
        self.most_taken = 0;
        self.rounds = self.first_rounds;
        if self.most_ever > 0 && !self.has_lacked {
            self.set_rounds(self.most_ever.saturating_mul(2).saturating_add(2));
            self.rounds = self.rounds.min(self.first_rounds);
        }
    }

    /// So many rounds were too few, as [`VplInfo::missing`] said: half as many again at least from
    /// now on, and as many as before any set. If those were too few, twice as many; unless there
    /// are more already, since other sets were begun before this one was known.
    pub fn lack_rounds(&mut self, taken: u32) {
        self.most_taken = self.most_taken.max(taken.saturating_add(taken / 2 + 1));
        self.recall_rounds(self.most_taken);
        if taken >= self.rounds.max(self.first_rounds) {
            self.raise_rounds(taken.saturating_mul(2));
        } else if self.rounds < self.most_taken {
            self.rounds = self.rounds.max(self.first_rounds);
        }
    }

    /// Rounds that are known to be needed, where those before any set were too few.
    pub fn needed_rounds(&self) -> Option<u32> {
        self.has_lacked.then_some(self.first_rounds)
    }

    /// At least so many rounds from now on, where [`VplInfo::missing`] said that there were too
    /// few.
    pub fn raise_rounds(&mut self, rounds: u32) {
        self.set_rounds(rounds.max(self.first_rounds));
        (self.first_rounds, self.has_lacked) = (self.rounds, true);
    }

    /// Never far beyond those after which tracing gives up in any case; batches are smaller than
    /// they might be where a set is nearly complete.
    pub(super) fn set_rounds(&mut self, rounds: u32) {
        let most = 16 + path_limit(self.count).div_ceil(self.batch.into());
        self.rounds = u64::from(rounds).clamp(1, most) as u32;
    }

    /// Traces a set; `vpls` has room for it by [`GpuVpls::new`].
    pub fn record(&self, rec: &mut Recorder<'_>, normal_maps: bool, seed: u32, vpls: &GpuVpls) {
        let (count, bounces) = (self.count, self.bounces);
        let normal_maps = normal_maps.into();
        let paths = rec.uniform(&PathParams { seed, bounces, normal_maps });
        let append = rec.uniform(&AppendParams { count, bounces });
        let limit = path_limit(count) as u32;
        let mut advance = AdvanceParams { count, capacity: self.batch, limit, first: 1 };
        let start = rec.uniform(&advance);
        advance.first = 0;
        let advance = rec.uniform(&advance);
        self.record_advance(rec, start, vpls);
        let (state, slots, offsets) = (&self.state, &self.slots, &self.offsets);
        for _ in 0..self.rounds {
            let trace = TracePaths { params: paths, state, slots, counts: offsets };
            rec.dispatch_indirect(&trace, &self.groups, 0);
            self.scan.record(rec, offsets, self.batch as usize + 1);
            let lights = &vpls.lights;
            let append = Append { params: append, state, offsets, slots, lights };
            rec.dispatch_indirect(&append, &self.groups, 0);
            self.record_advance(rec, advance, vpls);
        }
        let scale = Scale { info: &vpls.info, lights: &vpls.lights };
        rec.dispatch_items(&scale, vpls.lights.len());
    }

    fn record_advance(
        &self,
        rec: &mut Recorder<'_>,
        params: Uniform<AdvanceParams>,
        vpls: &GpuVpls,
    ) {
        let Self { offsets, state, groups, .. } = self;
        let advance = Advance { params, offsets, state, info: &vpls.info, groups };
        rec.dispatch(&advance, [1, 1, 1]);
    }
}

#[cfg(test)]
impl VplTracer {
    /// As many rounds as before any set.
    pub fn forget_rounds(&mut self) {
        (self.rounds, self.most_taken, self.most_ever) = (self.first_rounds, 0, 0);
    }
}

/// Paths after which tracing gives up: whole batches of the processor's.
fn path_limit(count: u32) -> u64 {
    let limit = (u64::from(count) * PATHS_PER_LIGHT).min(u64::from(u32::MAX - BATCH));
    limit.next_multiple_of(BATCH.into())
}

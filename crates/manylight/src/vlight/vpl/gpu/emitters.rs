//! Virtual lights on emissive triangles, on the device.

use super::{GpuVpls, VplInfo, VplRecord};
use crate::error::Error;
use crate::gpu::scan::Scan;
use crate::gpu::{Buf, Constant, GROUP, MAX_GROUPS, Memory, Recorder, Value, kernel, record};
use crate::{bvh, emitter, world};

const CONSTANTS: &[Constant] = &[Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) }];

record! {
    /// What both kernels need to know.
    struct EmitterParams {
        /// Draws.
        count: u32,
        /// Of the sequence whose points are draws.
        seed: u32,
    }
}

kernel! {
    /// Which draws shine.
    struct FindEmitters = "vlight/vpl/gpu/find_emitters", [GROUP, 1, 1], scene,
        [CONSTANTS, emitter::gpu::CONSTANTS, world::gpu::CONSTANTS, bvh::gpu::CONSTANTS];
    uniform params: EmitterParams, write shines: u32
}

kernel! {
    /// Those that shine, in order.
    struct PlaceEmitters = "vlight/vpl/gpu/place_emitters", [GROUP, 1, 1], scene,
        [CONSTANTS, emitter::gpu::CONSTANTS, world::gpu::CONSTANTS, bvh::gpu::CONSTANTS];
    uniform params: EmitterParams, read offsets: u32, write lights: VplRecord,
    write info: VplInfo
}

/// Every kernel of this file.
#[cfg(test)]
pub(super) const KERNELS: &[&crate::gpu::KernelInfo] = &[&FindEmitters::INFO, &PlaceEmitters::INFO];

/// Places virtual lights on emissive triangles, in proportion to flux.
#[derive(Debug)]
pub struct EmitterTracer {
    count: u32,
    /// 1 for each draw that shines, then those before each.
    offsets: Buf<u32>,
    scan: Scan,
}

impl EmitterTracer {
    /// Memory for `count` draws.
    ///
    /// Errors: more than the device can hold in one list
    pub fn new(memory: &impl Memory, count: u32) -> Result<Self, Error> {
        let most = count as usize + 1;
        let offsets = memory.list("draws on emitters", most)?;
        Ok(Self { count, offsets, scan: Scan::new(memory, most)? })
    }

    /// Draws the lights; `vpls` has room for as many by [`GpuVpls::new`] with one bounce.
    pub fn record(&self, rec: &mut Recorder<'_>, seed: u32, vpls: &GpuVpls) {
        let count = self.count as usize;
        let params = rec.uniform(&EmitterParams { count: self.count, seed });
        rec.dispatch_items(&FindEmitters { params, shines: &self.offsets }, count);
        self.scan.record(rec, &self.offsets, count + 1);
        let GpuVpls { lights, info } = vpls;
        let place = PlaceEmitters { params, offsets: &self.offsets, lights, info };
        // One invocation at least says how many there are.
        rec.dispatch_items(&place, count.max(1));
    }
}

//! Every virtual light with a shadow ray each, on the device, a run of lights after the other.
//!
//! In: [`GpuReceivers`], virtual lights · Out: [`GpuBrute`]
//! Sums are made in blocks of `BLOCK` lights, so that single precision is enough, and are the
//! same whatever the runs are.

use crate::error::Error;
use crate::gpu::{Buf, Constant, Gpu, MAX_GROUPS, Pace, SceneGroup, Value, kernel, record};
use crate::surface::gpu::GpuReceivers;
use crate::vlight::vpl::gpu::VplRecord;
use crate::{bvh, direct, shadow, surface, world};
use std::time::Instant;

/// Lights that are summed by themselves.
const BLOCK: usize = 64;
/// Most receivers of a dispatch.
const TILE: usize = 1 << 18;
/// Receivers × lights of the first submission.
const FIRST_PAIRS: usize = 1 << 22;
/// Receivers of a workgroup: their rays go to the same lights.
const GROUP: u32 = 64;

const CONSTANTS: &[Constant] = &[
    Constant { name: "BRUTE_BLOCK", value: Value::U32(BLOCK as u32) },
    Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) },
];

record! {
    /// What [`Sum`] needs to know.
    struct SumParams {
        /// First receiver of the tile.
        first_pixel: u32,
        /// Receivers of the tile.
        pixels: u32,
        /// First light of the run, a multiple of `BLOCK`; 0 begins the sums.
        first_light: u32,
        /// Light after the run.
        end_light: u32,
        /// Square of the distance clamp, m².
        d_min_sq: f32,
    }
}

record! {
    /// What [`Finish`] needs to know.
    struct FinishParams {
        /// First receiver of the tile.
        first_pixel: u32,
        /// Receivers of the tile.
        pixels: u32,
    }
}

record! {
    /// What all lights so far give one receiver.
    struct SumRecord {
        /// Without visibility, W·m⁻².
        unshadowed: [f32; 3],
        /// Lights with a contribution above zero.
        evals: u32,
        /// With visibility, W·m⁻².
        shadowed: [f32; 3],
        /// Nothing.
        _pad: u32,
    }
}

kernel! {
    /// Sums a run of lights.
    struct Sum = "gather/brute/sum", [GROUP, 1, 1], scene,
        [CONSTANTS, shadow::gpu::CONSTANTS, surface::gpu::CONSTANTS, world::gpu::CONSTANTS,
         bvh::gpu::CONSTANTS];
    uniform params: SumParams, read positions: [f32; 4], read normals: [f32; 4],
    read lights: VplRecord, write sums: SumRecord
}

kernel! {
    /// Sums as planes.
    struct Finish = "gather/brute/finish", [crate::gpu::GROUP, 1, 1],
        [CONSTANTS, direct::gpu::CONSTANTS];
    uniform params: FinishParams, read sums: SumRecord, write unshadowed: [f32; 4],
    write shadowed: [f32; 4], write ratios: [f32; 2]
}

/// Every kernel of this file.
#[cfg(test)]
pub(crate) const KERNELS: &[&crate::gpu::KernelInfo] = &[&Sum::INFO, &Finish::INFO];

/// What all lights together give every receiver.
#[derive(Debug)]
pub struct GpuBrute {
    /// Without visibility, W·m⁻²; the fourth: lights with a contribution above zero.
    pub unshadowed: Buf<[f32; 4]>,
    /// With visibility, W·m⁻².
    pub shadowed: Buf<[f32; 4]>,
    /// Share that arrives by luminance, and its trust of 1.
    pub ratios: Buf<[f32; 2]>,
    sums: Buf<SumRecord>,
}

impl GpuBrute {
    /// Room for the receivers of a picture.
    ///
    /// Errors: more than the device can hold in one list
    pub fn new(gpu: &Gpu, pixels: usize) -> Result<Self, Error> {
        Ok(Self {
            unshadowed: gpu.buffer("unshadowed irradiance", pixels)?,
            shadowed: gpu.buffer("shadowed irradiance", pixels)?,
            ratios: gpu.buffer("shadow ratios", pixels)?,
            sums: gpu.buffer("sums of all lights", pixels.min(TILE))?,
        })
    }

    /// Sums the first `count` of `lights` at every receiver; tells the share of work done.
    ///
    /// Waits for the device between runs, which are chosen so that none is long.
    /// Errors: what the device reported
    pub fn gather(
        &self,
        gpu: &Gpu,
        scene: &SceneGroup,
        receivers: &GpuReceivers,
        (lights, count): (&Buf<VplRecord>, usize),
        d_min: f32,
        progress: &dyn Fn(f64),
    ) -> Result<(), Error> {
        let GpuReceivers { positions, normals, .. } = receivers;
        let all = receivers.width * receivers.height;
        let mut pace = Pace::new(FIRST_PAIRS);
        let mut first_pixel = 0;
        while first_pixel < all {
            let pixels = pace.share(BLOCK, TILE.min(all - first_pixel));
            let mut first = 0;
            loop {
                // Where turns are counted, a block leaves some thousand to each of its rays.
                let run = if gpu.most_turns().is_some() { BLOCK } else { pace.times(pixels) };
                let run = run.next_multiple_of(BLOCK).max(BLOCK);
                let end = count.min(first + run);
                let started = Instant::now();
                let mut rec = gpu.record(Some(scene));
                rec.stage("brute");
                let params = rec.uniform(&SumParams {
                    first_pixel: first_pixel as u32,
                    pixels: pixels as u32,
                    first_light: first as u32,
                    end_light: end as u32,
                    d_min_sq: d_min * d_min,
                });
                let sums = &self.sums;
                rec.dispatch_items(&Sum { params, positions, normals, lights, sums }, pixels);
                if end == count {
                    self.record_finish(&mut rec, first_pixel, pixels);
                }
                rec.submit().wait()?;
                let share = if end == count { 1.0 } else { end as f64 / count as f64 };
                progress((first_pixel as f64 + pixels as f64 * share) / all as f64);
                pace.learn(pixels * (end - first), started.elapsed());
                if end == count {
                    break;
                }
                first = end;
            }
            first_pixel += pixels;
        }
        Ok(())
    }

    fn record_finish(&self, rec: &mut crate::gpu::Recorder<'_>, first_pixel: usize, pixels: usize) {
        let params = FinishParams { first_pixel: first_pixel as u32, pixels: pixels as u32 };
        let params = rec.uniform(&params);
        let Self { sums, unshadowed, shadowed, ratios } = self;
        rec.dispatch_items(&Finish { params, sums, unshadowed, shadowed, ratios }, pixels);
    }
}

#[cfg(test)]
mod tests;

//! Direct light on the graphics device: a kernel for lights without a surface, one for the sky.
//!
//! In: [`GpuReceivers`], the scene in group 1 · Out: a plane of irradiance; the sky's with the
//! plane of its shadow ratio

use super::{EXACT_LIGHTS, SKY_CANDIDATES};
use crate::error::Error;
use crate::gpu::{
    Buf, Constant, GROUP, Gpu, MAX_GROUPS, Pace, Recorder, SceneGroup, Value, dispatches_of,
    kernel, record,
};
use crate::surface::gpu::GpuReceivers;
use crate::{bvh, emitter, shadow, surface, world};
use std::ops::Range;
use std::time::Instant;

/// Rays of the first submission where there are very many.
const FIRST_RAYS: usize = 1 << 20;

/// Constants of this room's shaders.
pub const CONSTANTS: &[Constant] = &[
    Constant { name: "EXACT_LIGHTS", value: Value::U32(EXACT_LIGHTS as u32) },
    Constant { name: "SKY_CANDIDATES", value: Value::U32(SKY_CANDIDATES) },
    Constant { name: "SMALLEST", value: Value::F32(f32::MIN_POSITIVE) },
];
const LISTS: &[Constant] = &[Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) }];

record! {
    /// What [`FromLights`] needs to know.
    struct LightParams {
        /// First receiver.
        first: u32,
        /// End of the receivers.
        end: u32,
        /// Of the draws where there are many lights.
        seed: u32,
    }
}

record! {
    /// What [`FromSky`] needs to know.
    struct SkyParams {
        /// First receiver.
        first: u32,
        /// End of the receivers.
        end: u32,
        /// Pixels across.
        width: u32,
        /// Rays per receiver.
        rays: u32,
        /// Of the sequence that all receivers share.
        seed: u32,
        /// 1: the irradiance is what arrives, and the share of it 1.
        exact: u32,
    }
}

kernel! {
    /// Irradiance from sun, point and spot lights.
    struct FromLights = "direct/from_lights", [GROUP, 1, 1], scene,
        [CONSTANTS, LISTS, emitter::gpu::CONSTANTS, shadow::gpu::CONSTANTS,
         surface::gpu::CONSTANTS, world::gpu::CONSTANTS, bvh::gpu::CONSTANTS];
    uniform params: LightParams, read positions: [f32; 4], read normals: [f32; 4],
    write irradiance: [f32; 4]
}

kernel! {
    /// Irradiance from the sky and its shadow ratio.
    struct FromSky = "direct/from_sky", [GROUP, 1, 1], scene,
        [CONSTANTS, LISTS, emitter::gpu::CONSTANTS, shadow::gpu::CONSTANTS,
         surface::gpu::CONSTANTS, world::gpu::CONSTANTS, bvh::gpu::CONSTANTS];
    uniform params: SkyParams, read positions: [f32; 4], read normals: [f32; 4],
    write unshadowed: [f32; 4], write ratios: [f32; 2]
}

/// Every kernel of this room.
#[cfg(test)]
pub(crate) const KERNELS: &[&crate::gpu::KernelInfo] = &[&FromLights::INFO, &FromSky::INFO];

/// Irradiance of every receiver from sun, point and spot lights, with visibility, W·m⁻².
///
/// `seed` as in the frame on the processor: that of the sample.
pub fn record_lights(
    rec: &mut Recorder<'_>,
    receivers: &GpuReceivers,
    seed: u32,
    irradiance: &Buf<[f32; 4]>,
) {
    let GpuReceivers { positions, normals, .. } = receivers;
    for part in dispatches_of(receivers.width * receivers.height, EXACT_LIGHTS) {
        let (first, end) = (part.start as u32, part.end as u32);
        let params = rec.uniform(&LightParams { first, end, seed });
        rec.dispatch_items(&FromLights { params, positions, normals, irradiance }, part.len());
    }
}

/// How the sky is asked for.
#[derive(Clone, Copy, Debug)]
pub struct SkyRays {
    /// Rays per receiver, at least 1.
    pub rays: u32,
    /// Of the sequence that all receivers share.
    pub seed: u32,
    /// Whether the irradiance is to be what arrives in every channel, with ratios of 1: for rays
    /// that are enough, whose ratio nobody smooths.
    pub exact: bool,
}

/// Irradiance of every receiver from the sky without visibility, W·m⁻², and the ratio of it that
/// arrives with its trust of 1.
pub fn record_sky(
    rec: &mut Recorder<'_>,
    receivers: &GpuReceivers,
    sky: SkyRays,
    unshadowed: &Buf<[f32; 4]>,
    ratios: &Buf<[f32; 2]>,
) {
    for part in dispatches_of(receivers.width * receivers.height, sky.rays as usize) {
        record_sky_part(rec, receivers, sky, (unshadowed, ratios), part);
    }
}

/// The same for some of the receivers.
fn record_sky_part(
    rec: &mut Recorder<'_>,
    receivers: &GpuReceivers,
    sky: SkyRays,
    (unshadowed, ratios): (&Buf<[f32; 4]>, &Buf<[f32; 2]>),
    part: Range<usize>,
) {
    let params = rec.uniform(&SkyParams {
        first: part.start as u32,
        end: part.end as u32,
        width: receivers.width as u32,
        rays: sky.rays,
        seed: sky.seed,
        exact: sky.exact.into(),
    });
    let GpuReceivers { positions, normals, .. } = receivers;
    rec.dispatch_items(&FromSky { params, positions, normals, unshadowed, ratios }, part.len());
}

/// The same for very many rays, in submissions of which none is long; tells the share of work
/// done, and at last what the stage took.
///
/// Waits for the device. Errors: what the device reported
pub fn trace_sky(
    gpu: &Gpu,
    scene: &SceneGroup,
    receivers: &GpuReceivers,
    sky: SkyRays,
    lists: (&Buf<[f32; 4]>, &Buf<[f32; 2]>),
    progress: &dyn Fn(f64),
) -> Result<f64, Error> {
    let (all, rays) = (receivers.width * receivers.height, sky.rays as usize);
    let mut pace = Pace::new(FIRST_RAYS);
    let mut first = 0;
    let start = Instant::now();
    while first < all {
        let pixels = pace.share(rays, all - first);
        let started = Instant::now();
        let mut rec = gpu.record(Some(scene));
        rec.stage("sky");
        record_sky_part(&mut rec, receivers, sky, lists, first..first + pixels);
        rec.submit().wait()?;
        pace.learn(pixels * rays, started.elapsed());
        first += pixels;
        progress(first as f64 / all as f64);
    }
    Ok(start.elapsed().as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests;

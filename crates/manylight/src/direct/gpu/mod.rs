//! Direct light on the graphics device: a kernel for lights without a surface, one for the sky.
//!
//! In: [`GpuReceivers`], the scene in group 1 · Out: a plane of irradiance; the sky's with the
//! plane of its shadow ratio

use super::{EXACT_LIGHTS, SKY_CANDIDATES};
use crate::gpu::{Buf, Constant, GROUP, MAX_GROUPS, Recorder, Value, kernel, record};
use crate::surface::gpu::GpuReceivers;
use crate::{bvh, emitter, shadow, surface, world};

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
        /// Receivers.
        pixels: u32,
        /// Of the draws where there are many lights.
        seed: u32,
    }
}

record! {
    /// What [`FromSky`] needs to know.
    struct SkyParams {
        /// Receivers.
        pixels: u32,
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
    let pixels = receivers.width * receivers.height;
    let params = rec.uniform(&LightParams { pixels: pixels as u32, seed });
    let GpuReceivers { positions, normals, .. } = receivers;
    rec.dispatch_items(&FromLights { params, positions, normals, irradiance }, pixels);
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
    let pixels = receivers.width * receivers.height;
    let params = rec.uniform(&SkyParams {
        pixels: pixels as u32,
        width: receivers.width as u32,
        rays: sky.rays,
        seed: sky.seed,
        exact: sky.exact.into(),
    });
    let GpuReceivers { positions, normals, .. } = receivers;
    rec.dispatch_items(&FromSky { params, positions, normals, unshadowed, ratios }, pixels);
}

#[cfg(test)]
mod tests;

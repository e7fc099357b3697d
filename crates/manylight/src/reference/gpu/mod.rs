//! The path tracer on the device: one path per pixel and dispatch.
//!
//! In: the scene in group 1, a view · Out: [`GpuPaths`]
//! Sums are made in blocks of `BLOCK` samples, so that single precision is enough, and are the
//! same whatever the submissions are.

use super::PIXEL_KEY;
use crate::error::Error;
use crate::gpu::{
    Buf, Constant, Gpu, MAX_GROUPS, Pace, Recorder, SceneGroup, Value, kernel, record,
};
use crate::surface::ViewFrame;
use crate::surface::gpu::ViewRecord;
use crate::{bvh, direct, emitter, shadow, world};
use glam::Vec2;
use std::time::Instant;

/// Samples that are summed by themselves.
const BLOCK: u32 = 32;
/// Most pixels of a dispatch.
const TILE: usize = 1 << 18;
/// Paths of the first submission.
const FIRST_PATHS: usize = 1 << 14;
/// Paths of a workgroup: few, since their lengths differ.
const GROUP: u32 = 64;

const CONSTANTS: &[Constant] = &[
    Constant { name: "MAX_GROUPS", value: Value::U32(MAX_GROUPS) },
    Constant { name: "PIXEL_KEY", value: Value::U32(PIXEL_KEY) },
];

record! {
    /// What [`Trace`] needs to know.
    struct TraceParams {
        /// The camera.
        view: ViewRecord,
        /// Of the picture.
        seed: u32,
        /// Which sample.
        sample: u32,
        /// Reflections between the first surface and the light.
        bounces: u32,
        /// 1: normal textures bend normals.
        normal_maps: u32,
        /// First pixel of the tile.
        first_pixel: u32,
        /// Pixels of the tile.
        pixels: u32,
        /// 1: the sums begin.
        begins: u32,
        /// Nothing.
        _pad: u32,
    }
}

record! {
    /// What [`Fold`] needs to know.
    struct FoldParams {
        /// First pixel of the tile.
        first_pixel: u32,
        /// Pixels of the tile.
        pixels: u32,
        /// 1: the sums of the picture begin.
        begins: u32,
        /// 1, and at the end one over the number of samples.
        scale: f32,
    }
}

kernel! {
    /// One path per pixel.
    struct Trace = "reference/trace", [GROUP, 1, 1], scene,
        [CONSTANTS, direct::gpu::CONSTANTS, emitter::gpu::CONSTANTS, shadow::gpu::CONSTANTS,
         world::gpu::CONSTANTS, bvh::gpu::CONSTANTS];
    uniform params: TraceParams, write emission: [f32; 4], write direct: [f32; 4],
    write indirect: [f32; 4]
}

kernel! {
    /// Sums of blocks.
    struct Fold = "reference/fold", [crate::gpu::GROUP, 1, 1], [CONSTANTS];
    uniform params: FoldParams, read emission: [f32; 4], read direct: [f32; 4],
    read indirect: [f32; 4], write all_emission: [f32; 4], write all_direct: [f32; 4],
    write all_indirect: [f32; 4]
}

/// Every kernel of this room.
#[cfg(test)]
pub(crate) const KERNELS: &[&crate::gpu::KernelInfo] = &[&Trace::INFO, &Fold::INFO];

/// What the paths of a picture are.
#[derive(Clone, Copy, Debug)]
pub struct Paths {
    /// Paths per pixel.
    pub spp: u32,
    /// Reflections between the first surface and the light, as for virtual lights.
    pub bounces: u32,
    /// Whether normal textures bend normals.
    pub normal_maps: bool,
    /// Chooses the random numbers.
    pub seed: u32,
}

/// Mean radiance per pixel, W·m⁻²·sr⁻¹; the fourth numbers are 0.
#[derive(Debug)]
pub struct GpuPaths {
    /// What the camera sees shine.
    pub emission: Buf<[f32; 4]>,
    /// One surface between light and eye.
    pub direct: Buf<[f32; 4]>,
    /// Two or more.
    pub indirect: Buf<[f32; 4]>,
    /// Sums of a block of samples: emission, direct, indirect.
    block: [Buf<[f32; 4]>; 3],
}

/// A run of pixels.
#[derive(Clone, Copy)]
struct Tile {
    first_pixel: u32,
    pixels: u32,
}

impl GpuPaths {
    /// Room for a picture.
    ///
    /// Errors: more pixels than the device can hold in one list
    pub fn new(gpu: &Gpu, pixels: usize) -> Result<Self, Error> {
        let block = || gpu.buffer("radiance of a block of samples", pixels.min(TILE));
        Ok(Self {
            emission: gpu.buffer("emitted radiance", pixels)?,
            direct: gpu.buffer("direct radiance", pixels)?,
            indirect: gpu.buffer("indirect radiance", pixels)?,
            block: [block()?, block()?, block()?],
        })
    }

    /// Traces a picture, the same paths as on the processor; tells the share of work done.
    ///
    /// Waits for the device between submissions, which are chosen so that none is long.
    /// Errors: what the device reported
    pub fn trace(
        &self,
        gpu: &Gpu,
        scene: &SceneGroup,
        view: &ViewFrame,
        paths: &Paths,
        progress: &dyn Fn(f64),
    ) -> Result<(), Error> {
        let all = view.width * view.height;
        let mut pace = Pace::new(FIRST_PATHS);
        let mut first = 0;
        while first < all {
            let pixels = pace.share(1, TILE.min(all - first));
            let tile = Tile { first_pixel: first as u32, pixels: pixels as u32 };
            let mut sample = 0;
            while sample < paths.spp {
                let run = pace.times(pixels).clamp(1, 2 * BLOCK as usize);
                let end = sample.saturating_add(run as u32).min(paths.spp);
                let started = Instant::now();
                let mut rec = gpu.record(Some(scene));
                rec.stage("paths");
                for sample in sample..end {
                    self.record_sample(&mut rec, view, paths, tile, sample);
                }
                rec.submit().wait()?;
                let done = f64::from(end) / f64::from(paths.spp);
                progress((first as f64 + pixels as f64 * done) / all as f64);
                pace.learn(pixels * (end - sample) as usize, started.elapsed());
                sample = end;
            }
            first += pixels;
        }
        Ok(())
    }

    /// One sample of a tile; at the end of a block its sums are added to those of the picture.
    fn record_sample(
        &self,
        rec: &mut Recorder<'_>,
        view: &ViewFrame,
        paths: &Paths,
        Tile { first_pixel, pixels }: Tile,
        sample: u32,
    ) {
        let [emission, direct, indirect] = &self.block;
        let params = rec.uniform(&TraceParams {
            view: ViewRecord::new(view, Vec2::ZERO),
            seed: paths.seed,
            sample,
            bounces: paths.bounces,
            normal_maps: paths.normal_maps.into(),
            first_pixel,
            pixels,
            begins: u32::from(sample.is_multiple_of(BLOCK)),
            _pad: 0,
        });
        rec.dispatch_items(&Trace { params, emission, direct, indirect }, pixels as usize);
        let is_last = sample + 1 == paths.spp;
        if !is_last && !(sample + 1).is_multiple_of(BLOCK) {
            return;
        }
        let params = rec.uniform(&FoldParams {
            first_pixel,
            pixels,
            begins: u32::from(sample < BLOCK),
            scale: if is_last { 1.0 / paths.spp as f32 } else { 1.0 },
        });
        let fold = Fold {
            params,
            emission,
            direct,
            indirect,
            all_emission: &self.emission,
            all_direct: &self.direct,
            all_indirect: &self.indirect,
        };
        rec.dispatch_items(&fold, pixels as usize);
    }
}

#[cfg(test)]
mod tests;

//! Ray rates of the graphics device.

use super::RayBatch;
use crate::error::Error;
use crate::frame::gpu::GpuRenderer;
use crate::gpu::Buf;
use crate::gpu::Feature;
use crate::world::gpu::{BinaryWorld, Cast, CastParams, HitRecord};

/// The rays of a batch on the device.
#[derive(Debug)]
pub struct GpuRayBatch {
    rays: Buf<[f32; 8]>,
    hits: Buf<HitRecord>,
    stopped: Buf<u32>,
    binary: Option<BinaryWorld>,
}

impl GpuRayBatch {
    /// Copies the rays of a batch to the device.
    ///
    /// Errors: more than the device can hold in one list
    pub fn new(engine: &GpuRenderer, batch: &RayBatch) -> Result<Self, Error> {
        let record = |r: &crate::bvh::Ray| {
            let (o, d) = (r.origin, r.direction);
            [o.x, o.y, o.z, r.t_max, d.x, d.y, d.z, 0.0]
        };
        let records: Vec<[f32; 8]> = batch.rays.iter().map(record).collect();
        let gpu = engine.gpu();
        Ok(Self {
            rays: gpu.upload("rays", &records)?,
            hits: gpu.buffer("hits", records.len())?,
            stopped: gpu.buffer("stopped rays", records.len())?,
            binary: BinaryWorld::new(gpu, &engine.renderer().world)?,
        })
    }

    /// Who follows the rays of [`GpuRayBatch::trace`].
    pub fn walk(engine: &GpuRenderer) -> &'static str {
        match engine.gpu().features().has(Feature::RayQueries) {
            true => "ray queries",
            false => "shaders, eight wide",
        }
    }

    /// As [`GpuRayBatch::trace`], by shaders through a binary hierarchy; none where instances share
    /// their triangles, for which there is none.
    ///
    /// Errors: what the device reported
    pub fn trace_binary(
        &self,
        engine: &GpuRenderer,
    ) -> Result<Option<(usize, Option<f64>)>, Error> {
        let Some(binary) = &self.binary else { return Ok(None) };
        let (gpu, count) = (engine.gpu(), self.rays.len());
        let mut rec = gpu.record(Some(engine.scene()));
        rec.stage("rays");
        let params = rec.uniform(&CastParams { count: count as u32, any: 1 });
        rec.dispatch_items(&binary.cast(params, &self.rays, &self.stopped), count);
        let times = rec.submit().wait()?;
        let stopped = gpu.read(&self.stopped, count)?.into_iter().map(|stopped| stopped as usize);
        Ok(Some((stopped.sum(), times.first().map(|t| t.time_ms))))
    }

    /// Traces all rays; how many were stopped, and the time on the device, ms: none where it has no
    /// clock.
    ///
    /// Errors: what the device reported
    pub fn trace(&self, engine: &GpuRenderer) -> Result<(usize, Option<f64>), Error> {
        let (gpu, count) = (engine.gpu(), self.rays.len());
        let mut rec = gpu.record(Some(engine.scene()));
        rec.stage("rays");
        let params = rec.uniform(&CastParams { count: count as u32, any: 1 });
        rec.dispatch_items(&Cast { params, rays: &self.rays, hits: &self.hits }, count);
        let times = rec.submit().wait()?;
        let hits = gpu.read(&self.hits, count)?;
        let stopped = hits.iter().filter(|hit| hit.instance != u32::MAX).count();
        Ok((stopped, times.first().map(|t| t.time_ms)))
    }
}

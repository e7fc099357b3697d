//! Ray rates of the graphics device.

use super::RayBatch;
use crate::error::Error;
use crate::frame::gpu::GpuRenderer;
use crate::gpu::Buf;
use crate::world::gpu::{Cast, CastParams, HitRecord};

/// The rays of a batch on the device.
#[derive(Debug)]
pub struct GpuRayBatch {
    rays: Buf<[f32; 8]>,
    hits: Buf<HitRecord>,
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
        let hits = gpu.buffer("hits", records.len())?;
        Ok(Self { rays: gpu.upload("rays", &records)?, hits })
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

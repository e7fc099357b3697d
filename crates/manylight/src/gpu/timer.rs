//! Times of stages, by timestamps of the device.

use super::{Feature, Gpu};
use crate::error::Error;

/// Most timed passes of one submission.
const MOST_PASSES: u32 = 1024;

/// What one stage took on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTime {
    /// Name of the stage.
    pub name: &'static str,
    /// ms; summed where a stage ran more than once.
    pub time_ms: f64,
}

/// Timestamps around the passes of one submission.
#[derive(Debug)]
pub(super) struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    mapped: wgpu::Buffer,
    /// Whether a submission brings its timestamps there, and nobody has taken them.
    is_filled: bool,
    names: Vec<&'static str>,
}

impl Timer {
    pub fn new(gpu: &Gpu) -> Option<Self> {
        let device = gpu.device();
        if !gpu.features().has(Feature::Timestamps) {
            return None;
        }
        let size = u64::from(2 * MOST_PASSES) * 8;
        let buffer = |label, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        Some(Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timer"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * MOST_PASSES,
            }),
            resolved: buffer(
                "timer resolved",
                wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            ),
            mapped: buffer(
                "timer mapped",
                wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            ),
            is_filled: false,
            names: Vec::new(),
        })
    }

    pub fn clear(&mut self) {
        self.names.clear();
        if std::mem::take(&mut self.is_filled) {
            self.mapped.unmap();
        }
    }

    /// Where the next pass leaves its timestamps; none beyond the most passes.
    pub fn next(&mut self, name: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let index = self.names.len() as u32;
        if index >= MOST_PASSES {
            return None;
        }
        self.names.push(name);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * index),
            end_of_pass_write_index: Some(2 * index + 1),
        })
    }

    /// Brings the timestamps back with the submission.
    pub fn resolve(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if self.names.is_empty() {
            return;
        }
        let count = 2 * self.names.len() as u32;
        let bytes = u64::from(count) * 8;
        encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.mapped, 0, bytes);
        encoder.map_buffer_on_submit(&self.mapped, wgpu::MapMode::Read, ..bytes, |_| ());
        self.is_filled = true;
    }

    /// Takes the times of a submission that is done; stages in the order in which they first ran.
    pub fn take(&mut self, gpu: &Gpu) -> Result<Vec<StageTime>, Error> {
        if !self.is_filled {
            return Ok(Vec::new());
        }
        let bytes = self.names.len() as u64 * 2 * 8;
        let ticks: Vec<u64> = {
            let view = self.mapped.slice(..bytes).get_mapped_range();
            let view = view.map_err(|e| gpu.problem(&format!("reading times: {e}")))?;
            bytemuck::pod_collect_to_vec(&view)
        };
        let period_ms = f64::from(gpu.queue().get_timestamp_period()) * 1e-6;
        let mut stages: Vec<StageTime> = Vec::new();
        for (&name, pair) in self.names.iter().zip(ticks.chunks_exact(2)) {
            let time_ms = pair[1].saturating_sub(pair[0]) as f64 * period_ms;
            match stages.iter_mut().find(|s| s.name == name) {
                Some(stage) => stage.time_ms += time_ms,
                None => stages.push(StageTime { name, time_ms }),
            }
        }
        self.clear();
        Ok(stages)
    }
}

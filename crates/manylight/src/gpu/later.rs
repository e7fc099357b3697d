//! Records that come back when their submission is done, without anyone waiting for it.

use super::loops::Watch;
use super::{Gpu, Record, Recorder};
use crate::error::Error;
use std::sync::atomic::{Ordering, fence};
use std::sync::{Arc, OnceLock};

/// Records on their way back.
#[derive(Debug)]
pub struct Later {
    mapped: wgpu::Buffer,
    /// Set when they have come; shared with the recording alone.
    done: Arc<OnceLock<Result<(), wgpu::BufferAsyncError>>>,
}

/// Where such records are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// On their way.
    Pending,
    /// Here, one after another.
    Here(Vec<u8>),
    /// What was recorded was dropped before it was submitted.
    Never,
}

impl Recorder<'_> {
    /// Brings whole buffers back, as they are at this point of the recording, and with them what is
    /// known of loops that the driver ended early.
    pub fn read_later(&mut self, buffers: &[&wgpu::Buffer]) -> Later {
        let watched = self.gpu().watch().map(Watch::found);
        let buffers: Vec<_> = buffers.iter().copied().chain(watched).collect();
        let size = buffers.iter().map(|b| b.size()).sum::<u64>().max(4);
        let mapped = self.gpu().device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back later"),
            size,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let encoder = self.encoder();
        let mut at = 0;
        for buffer in buffers {
            encoder.copy_buffer_to_buffer(buffer, 0, &mapped, at, buffer.size());
            at += buffer.size();
        }
        let done = Arc::new(OnceLock::new());
        let come = done.clone();
        encoder.map_buffer_on_submit(&mapped, wgpu::MapMode::Read, .., move |result| {
            // It is called once.
            let _ = come.set(result);
        });
        Later { mapped, done }
    }
}

impl Later {
    /// Looks whether the records have come; [`Gpu::poll`] before makes that known.
    ///
    /// Errors: what the device reported; the driver ended loops early
    pub fn look(&self, gpu: &Gpu) -> Result<Arrival, Error> {
        // In this order: it is set before its other owner goes.
        let is_alone = Arc::strong_count(&self.done) == 1;
        fence(Ordering::Acquire);
        match self.done.get() {
            None if is_alone => Ok(Arrival::Never),
            None => Ok(Arrival::Pending),
            Some(Err(e)) => Err(problem(gpu, e)),
            Some(Ok(())) => self.bytes(gpu).map(Arrival::Here),
        }
    }

    /// The records of a submission that was waited for.
    ///
    /// Errors: what the device reported; the driver ended loops early
    pub fn bytes(&self, gpu: &Gpu) -> Result<Vec<u8>, Error> {
        let view = self.mapped.slice(..).get_mapped_range().map_err(|e| problem(gpu, &e))?;
        let mut bytes = view.to_vec();
        gpu.watch().map_or(Ok(()), |watch| watch.check(gpu, &mut bytes))?;
        Ok(bytes)
    }
}

fn problem(gpu: &Gpu, e: &dyn std::error::Error) -> Error {
    gpu.problem(&format!("reading back: {e}"))
}

/// Takes a record off the front of bytes that came.
///
/// Panics: where fewer are left
pub(crate) fn take_record<T: Record>(bytes: &mut &[u8]) -> T {
    let (record, rest) = bytes.split_at(size_of::<T>());
    *bytes = rest;
    bytemuck::pod_read_unaligned(record)
}

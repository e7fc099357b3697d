//! Virtual point lights on the graphics device: their record, and tracing them.

mod emitters;
mod trace;

pub use emitters::EmitterTracer;
pub use trace::VplTracer;

use super::Vpl;
use crate::error::Error;
use crate::gpu::{Buf, Gpu, Memory, record};

record! {
    /// [`Vpl`] as shaders read it.
    pub struct VplRecord {
        /// World position.
        pub position: [f32; 3],
        /// Nothing.
        pub _pad0: u32,
        /// Unit geometric normal of the side it shines from.
        pub normal: [f32; 3],
        /// Nothing.
        pub _pad1: u32,
        /// Radiant intensity along the normal, W·sr⁻¹.
        pub intensity: [f32; 3],
        /// Nothing.
        pub _pad2: u32,
    }
}

record! {
    /// How many lights a set has, as the device counted them.
    pub struct VplInfo {
        /// Lights.
        pub count: u32,
        /// Light paths that were traced for them.
        pub path_count: u32,
        /// Lights that are wanted and that more rounds would find; 0 in a complete set.
        pub missing: u32,
        /// Rounds that traced paths; 0 for lights on emitters.
        pub rounds: u32,
    }
}

/// A set of virtual lights on the device.
#[derive(Debug)]
pub struct GpuVpls {
    /// The lights, in path order; as many as `info` says.
    pub lights: Buf<VplRecord>,
    /// One record.
    pub info: Buf<VplInfo>,
}

impl From<&Vpl> for VplRecord {
    fn from(light: &Vpl) -> Self {
        Self {
            position: light.position.to_array(),
            normal: light.normal.to_array(),
            intensity: light.intensity.to_array(),
            ..Self::default()
        }
    }
}

impl GpuVpls {
    /// Room for a set of about `count` lights from paths of up to `bounces` hits.
    ///
    /// Errors: more than the device can hold in one list
    pub fn new(memory: &impl Memory, count: u32, bounces: u32) -> Result<Self, Error> {
        // The last path begins before the set is full.
        let most = count as usize + bounces.saturating_sub(1) as usize;
        Ok(Self {
            lights: memory.list("virtual lights", most)?,
            info: memory.gpu().buffer("number of virtual lights", 1)?,
        })
    }

    /// Copies lights to the device.
    ///
    /// Errors: more than the device can hold in one list
    pub fn upload(gpu: &Gpu, lights: &[Vpl], path_count: u32) -> Result<Self, Error> {
        let records: Vec<VplRecord> = lights.iter().map(VplRecord::from).collect();
        let info = VplInfo { count: lights.len() as u32, path_count, ..VplInfo::default() };
        Ok(Self {
            lights: gpu.upload("virtual lights", &records)?,
            info: gpu.upload("number of virtual lights", &[info])?,
        })
    }
}

/// Every kernel of this room.
#[cfg(test)]
pub(crate) const KERNELS: &[&[&crate::gpu::KernelInfo]] = &[trace::KERNELS, emitters::KERNELS];

#[cfg(test)]
mod tests;

//! The graphics device: typed buffers, linked shaders, recorded dispatches, stage times.
//!
//! In: an adapter of this machine, or an engine's device and queue · Out: [`Gpu`], [`Buf`],
//! [`Recorder`]
//! Knows no light transport. Kernels are declared by `kernel!` in the `gpu.rs` of their room,
//! records they share with Rust by `record!`; a test compares both with the shaders.
//! Limits: `wgpu::Limits::defaults()` and no optional feature is enough; [`Features`] are used
//! where a device offers them.

mod adapter;
mod buffer;
mod device;
#[cfg(debug_assertions)]
mod faults;
mod features;
mod groups;
mod kernel;
mod later;
mod linker;
mod loops;
mod pace;
mod pipelines;
mod pool;
mod recorder;
#[cfg(debug_assertions)]
mod reload;
pub mod scan;
mod scene;
mod shaders;
#[cfg(test)]
pub(crate) mod testing;
mod timer;

pub use adapter::{AdapterDescription, GpuOptions, describe_adapters};
pub(crate) use buffer::record;
pub use buffer::{Buf, HeldBytes, Record};
pub use device::Gpu;
#[cfg(debug_assertions)]
pub use faults::{Faults, Suspect};
pub use features::{Feature, Features, Variant};
pub use groups::Place;
pub(crate) use kernel::kernel;
pub use kernel::{Access, Bound, Constant, Kernel, KernelInfo, Port, STORE_FORMAT, Value};
pub(crate) use later::take_record;
pub use later::{Arrival, Later};
pub use linker::{Sources, link};
pub use pace::{Pace, dispatches_of};
pub use pool::{Memory, Phase, Pool, Together};
pub use recorder::{Recorder, Uniform, UniformMemory};
pub use scene::{SceneGroup, SceneTraits};
pub use shaders::SHADERS;
pub use timer::StageTime;

/// Items that one workgroup of a kernel over a list works on.
pub const GROUP: u32 = 256;
/// Most workgroups along one dimension of a dispatch.
pub const MAX_GROUPS: u32 = 65_535;

/// Every kernel of this room.
#[cfg(test)]
pub(crate) const KERNELS: &[&[&KernelInfo]] = &[
    scan::KERNELS,
    loops::KERNELS,
    #[cfg(debug_assertions)]
    faults::KERNELS,
];

#[cfg(test)]
mod tests;

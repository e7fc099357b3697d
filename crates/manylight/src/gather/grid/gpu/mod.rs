//! The hierarchy on the graphics device.

mod alpha;
mod build;
mod capacity;
mod gather;
mod params;
pub mod record;
mod upload;

pub use build::{GridBuild, GridRules, fine_levels};
pub use capacity::{GatherCapacity, band_evals};
pub use gather::{Gather, GatherInput, GatherOut};
pub use params::{GatherStats, Reach};
pub use record::{GpuGrid, GridCapacity, GridInfo};
pub use upload::PackedGrid;

use crate::gpu::{Constant, Value};

/// Constants of `record.wgsl`.
pub(super) const RECORD_CONSTANTS: &[Constant] =
    &[Constant { name: "LEVEL_ENTRIES", value: Value::U32(record::LEVEL_ENTRIES as u32) }];

#[cfg(test)]
mod capacity_tests;
#[cfg(test)]
mod gather_tests;
#[cfg(test)]
mod interleave_tests;

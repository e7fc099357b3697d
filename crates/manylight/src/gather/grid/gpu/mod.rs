//! The hierarchy on the graphics device.

pub mod record;

pub use record::{GpuGrid, GridInfo};

use crate::gpu::{Constant, Value};

/// Constants of `record.wgsl`.
pub(super) const RECORD_CONSTANTS: &[Constant] =
    &[Constant { name: "LEVEL_ENTRIES", value: Value::U32(record::LEVEL_ENTRIES as u32) }];

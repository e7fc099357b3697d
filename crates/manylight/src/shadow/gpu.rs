//! Shadow rays on the graphics device.

use super::SEGMENT_END;
use crate::gpu::{Constant, Value};

/// Constants of the room's shaders.
pub const CONSTANTS: &[Constant] =
    &[Constant { name: "SEGMENT_END", value: Value::F32(SEGMENT_END) }];

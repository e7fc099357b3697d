//! Scenes made by our own code.

use crate::Shot;

/// Names that [`builtin`] knows.
pub const BUILTINS: &[&str] = &[];

/// The procedural scene of this name, or `None`.
pub fn builtin(_name: &str) -> Option<Shot> {
    None
}

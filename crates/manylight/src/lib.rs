//! manylight.

//! How far two pictures are apart.
//!
//! In: a picture `a` and the reference `b` of the same shape. Out: numbers or error maps.
//! Papers: `[Andersson20]` for FLIP, `[Andersson21]` for HDR-FLIP.
//! Limits: pixels with NaN or ±∞ in either picture are counted and left out of the sums;
//! for FLIP they count as black in both.

mod color;
mod error;
mod filter;
mod flip;

pub use error::{Errors, compare, compute_rel_mse};
pub use flip::{flip_hdr, flip_ldr};

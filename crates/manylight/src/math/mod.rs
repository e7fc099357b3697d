//! Numbers only: random sequences, warps, frames, discrete distributions.
//!
//! In: numbers · Out: numbers · Limits: knows no scene and no light.

mod discrete;
mod frame;
mod sequence;
mod warp;

pub use discrete::Discrete;
pub use frame::tangent_frame;
pub use sequence::{Sequence, hash_u32, morton_2d, unit_f32};
pub use warp::{cosine_hemisphere, sin_cos_turns, uniform_cone, uniform_sphere, uniform_triangle};

use glam::Vec3;

/// Luminance of linear Rec.709.
#[inline]
pub fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

#[cfg(test)]
mod tests;

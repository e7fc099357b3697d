//! Many lights become one irradiance per receiver.
//!
//! In: [`Receivers`](crate::surface::Receivers), virtual lights · Out: [`Gathered`]
//! Contract: every gather is judged against [`brute`] with the same lights and receivers.

pub mod brute;
pub mod grid;

use glam::Vec3;

/// Irradiance at every receiver.
///
/// Shapes: `[height · width]` each
#[derive(Clone, Debug)]
pub struct Gathered {
    /// Without visibility, W·m⁻².
    pub unshadowed: Vec<Vec3>,
    /// Share of `unshadowed` that arrives, 0…1 (weighted estimates may pass 1 slightly).
    pub shadow_ratio: Vec<f32>,
    /// Lights evaluated with a contribution above zero.
    pub evals: Vec<u32>,
}

impl Gathered {
    /// All zero, ratio one.
    pub fn dark(pixels: usize) -> Self {
        Self {
            unshadowed: vec![Vec3::ZERO; pixels],
            shadow_ratio: vec![1.0; pixels],
            evals: vec![0; pixels],
        }
    }
}

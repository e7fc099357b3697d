//! Many lights become one irradiance per receiver.
//!
//! In: [`Receivers`](crate::surface::Receivers), virtual lights · Out: [`Gathered`]
//! Contract: every gather is judged against [`brute`] with the same lights and receivers.

pub mod brute;
pub mod grid;

use crate::math::luminance;
use glam::Vec3;

/// Irradiance at every receiver.
///
/// Shapes: `[height · width]` each
#[derive(Clone, Debug)]
pub struct Gathered {
    /// Without visibility, W·m⁻².
    pub unshadowed: Vec<Vec3>,
    /// Share of `unshadowed` that arrives, 0…1, by luminance.
    pub shadow_ratio: Vec<f32>,
    /// What the draws behind `shadow_ratio` weigh, beside 1 for draws as likely as they should be;
    /// empty where all weigh the same.
    pub trust: Vec<f32>,
    /// What arrives in every channel, W·m⁻², where it is known and no product of the other two;
    /// else empty.
    pub shadowed: Vec<Vec3>,
    /// Lights evaluated with a contribution above zero.
    pub evals: Vec<u32>,
    /// Reach of the levels, where a grid gathered.
    pub alpha: Option<f32>,
}

impl Gathered {
    /// All zero, ratio one.
    pub fn dark(pixels: usize) -> Self {
        Self {
            unshadowed: vec![Vec3::ZERO; pixels],
            shadow_ratio: vec![1.0; pixels],
            trust: Vec::new(),
            shadowed: Vec::new(),
            evals: vec![0; pixels],
            alpha: None,
        }
    }

    /// Irradiance of receiver `i` with visibility, W·m⁻².
    pub fn arriving(&self, i: usize) -> Vec3 {
        self.shadowed.get(i).copied().unwrap_or(self.unshadowed[i] * self.shadow_ratio[i])
    }

    /// Keeps exact sums, one per receiver: unshadowed and shadowed.
    pub fn set_exact(&mut self, sums: impl Iterator<Item = [Vec3; 2]>) {
        self.shadowed.clear();
        for (i, [unshadowed, shadowed]) in sums.enumerate() {
            let share = luminance(shadowed) / luminance(unshadowed).max(f32::MIN_POSITIVE);
            self.unshadowed[i] = unshadowed;
            self.shadow_ratio[i] = if unshadowed == Vec3::ZERO { 1.0 } else { share };
            self.shadowed.push(shadowed);
        }
    }
}

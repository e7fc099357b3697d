//! Virtual point lights: record, birth, and what one gives a receiver.
//!
//! In: world and emitters · Out: [`VplSet`] · Paper: `[Keller97]`, [Dachsbacher14, Sec. 3]
//! Limits: Lambertian; the distance clamp removes energy near corners.

#[cfg(feature = "gpu")]
pub mod gpu;
mod trace;

pub use trace::{trace, trace_emitters};

use glam::Vec3;

/// A virtual point light on a Lambertian surface.
///
/// E at a receiver = I · max(0, n_x·w) · max(0, −n·w) · min(1/d², 1/d_min²) · V
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vpl {
    /// World position.
    pub position: Vec3,
    /// Unit geometric normal of the side it shines from.
    pub normal: Vec3,
    /// Radiant intensity along the normal, W·sr⁻¹ (flux · ρ/π for a bounce).
    pub intensity: Vec3,
}

/// The virtual lights of a frame, already divided by the number of paths.
#[derive(Clone, Debug, Default)]
pub struct VplSet {
    /// The lights, in path order.
    pub lights: Vec<Vpl>,
    /// Light paths that were traced for them.
    pub path_count: u64,
}

/// Irradiance a light gives a receiver, without visibility, W·m⁻².
///
/// Source: `[Keller97]`; differs: d is clamped below by d_min (`d_min_sq` = d_min²)
#[inline(always)]
pub fn irradiance(light: &Vpl, position: Vec3, normal: Vec3, d_min_sq: f32) -> Vec3 {
    light.intensity * geometry(light.position, light.normal, position, normal, d_min_sq)
}

/// max(0, n_x·w) · max(0, −n·w) · min(1/d², 1/d_min²), m⁻².
#[inline(always)]
pub fn geometry(p_light: Vec3, n_light: Vec3, p: Vec3, n: Vec3, d_min_sq: f32) -> f32 {
    let offset = p_light - p;
    let dist_sq = offset.length_squared();
    let cosines = n.dot(offset).max(0.0) * (-n_light.dot(offset)).max(0.0);
    // Where light and receiver coincide both cosines are zero; the floor avoids 0/0.
    cosines / (dist_sq * dist_sq.max(d_min_sq)).max(1e-30)
}

#[cfg(test)]
mod tests;

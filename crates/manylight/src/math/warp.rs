//! Maps from the unit square to directions and surfaces, with the density each has.

use super::tangent_frame;
use glam::Vec3;
use std::f32::consts::PI;

/// A direction around `n` with pdf_sa = cosθ/π.
#[inline]
pub fn cosine_hemisphere(n: Vec3, u: [f32; 2]) -> Vec3 {
    let (t, b) = tangent_frame(n);
    let radius = u[0].sqrt();
    let (sin, cos) = (2.0 * PI * u[1]).sin_cos();
    (t * (radius * cos) + b * (radius * sin) + n * (1.0 - u[0]).max(0.0).sqrt()).normalize()
}

/// A direction with pdf_sa = 1/4π.
#[inline]
pub fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u[1]).sin_cos();
    Vec3::new(radius * cos, radius * sin, z)
}

/// A direction within acos(`cos_outer`) of `axis` with pdf_sa = 1/(2π(1 − cos_outer)).
#[inline]
pub fn uniform_cone(axis: Vec3, cos_outer: f32, u: [f32; 2]) -> Vec3 {
    let z = 1.0 - u[0] * (1.0 - cos_outer);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = (2.0 * PI * u[1]).sin_cos();
    let (t, b) = tangent_frame(axis);
    t * (radius * cos) + b * (radius * sin) + axis * z
}

/// Barycentrics (of the second and third vertex) with pdf_area = 1/area.
#[inline]
pub fn uniform_triangle(u: [f32; 2]) -> [f32; 2] {
    let root = u[0].sqrt();
    [root * (1.0 - u[1]), root * u[1]]
}

//! Maps from the unit square to directions and surfaces, with the density each has.

use super::tangent_frame;
use glam::Vec3;
use std::f32::consts::FRAC_PI_2;

/// Sine and cosine of `turns` · 2π for 0 ≤ turns ≤ 1, to 1e-7.
///
/// By a series, so that graphics devices, whose own sines differ, go the same way: a light path
/// among thin things ends elsewhere after the smallest change.
#[inline]
pub fn sin_cos_turns(turns: f32) -> (f32, f32) {
    let quarters = (turns * 4.0 + 0.5).floor();
    let a = (turns * 4.0 - quarters) * FRAC_PI_2;
    let a2 = a * a;
    let sin_series = a2 * (1.0 / 120.0 - a2 * (1.0 / 5040.0 - a2 / 362_880.0)) - 1.0 / 6.0;
    let sin = a + a * a2 * sin_series;
    let cos_series = a2 * (1.0 / 24.0 - a2 * (1.0 / 720.0 - a2 / 40_320.0)) - 0.5;
    let cos = 1.0 + a2 * cos_series;
    match quarters as u32 % 4 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// A direction around `n` with pdf_sa = cosθ/π.
#[inline]
pub fn cosine_hemisphere(n: Vec3, u: [f32; 2]) -> Vec3 {
    let (t, b) = tangent_frame(n);
    let radius = u[0].sqrt();
    let (sin, cos) = sin_cos_turns(u[1]);
    (t * (radius * cos) + b * (radius * sin) + n * (1.0 - u[0]).max(0.0).sqrt()).normalize()
}

/// A direction with pdf_sa = 1/4π.
#[inline]
pub fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    let z = 1.0 - 2.0 * u[0];
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos_turns(u[1]);
    Vec3::new(radius * cos, radius * sin, z)
}

/// A direction within acos(`cos_outer`) of `axis` with pdf_sa = 1/(2π(1 − cos_outer)).
#[inline]
pub fn uniform_cone(axis: Vec3, cos_outer: f32, u: [f32; 2]) -> Vec3 {
    let z = 1.0 - u[0] * (1.0 - cos_outer);
    let radius = (1.0 - z * z).max(0.0).sqrt();
    let (sin, cos) = sin_cos_turns(u[1]);
    let (t, b) = tangent_frame(axis);
    t * (radius * cos) + b * (radius * sin) + axis * z
}

/// Barycentrics (of the second and third vertex) with pdf_area = 1/area.
#[inline]
pub fn uniform_triangle(u: [f32; 2]) -> [f32; 2] {
    let root = u[0].sqrt();
    [root * (1.0 - u[1]), root * u[1]]
}

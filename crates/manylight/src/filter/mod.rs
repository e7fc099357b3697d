//! Repairing the noise of the shadow ratio.
//!
//! In: ratio, receivers · Out: filtered ratio
//! Paper: `[Dammertz10]`; differs: no color guide on the signal itself, a plane distance instead of
//! a position distance. Known failure: shadows finer than the footprint of the first passes blur.

use crate::settings::FilterSettings;
use crate::surface::{Receivers, SurfacePoint};
use rayon::prelude::*;

/// One-dimensional B3 spline.
const KERNEL: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
/// Exponent of the normals' cosine.
const NORMAL_EXPONENT: i32 = 32;
/// Distance from the receiver's plane that halves a weight's exponent, per metre of depth.
const PLANE_SLACK: f32 = 0.01;
/// Albedo difference that counts as an edge.
const ALBEDO_SLACK: f32 = 0.4;

/// Smooths a per-receiver value along surfaces.
///
/// Shapes: values `[h·w]`; out `[h·w]`
/// Cost:   25 taps a pass and receiver
pub fn atrous(values: &[f32], receivers: &Receivers, settings: &FilterSettings) -> Vec<f32> {
    let mut current = values.to_vec();
    for pass in 0..settings.passes {
        let step = 1i64 << pass;
        current = (0..current.len())
            .into_par_iter()
            .with_min_len(1024)
            .map(|i| filter_pixel(&current, receivers, i, step))
            .collect();
    }
    current
}

fn filter_pixel(values: &[f32], receivers: &Receivers, index: usize, step: i64) -> f32 {
    let sample = &receivers.samples[index];
    let Some(center) = &sample.surface else { return values[index] };
    let (width, height) = (receivers.width as i64, receivers.height as i64);
    let (x, y) = (index as i64 % width, index as i64 / width);
    let plane_slack = 1.0 / (PLANE_SLACK * sample.depth.abs().max(1e-4) * step as f32);
    let (mut sum, mut total) = (0.0, 0.0);
    for (j, ky) in KERNEL.iter().enumerate() {
        let yy = y + (j as i64 - 2) * step;
        if yy < 0 || yy >= height {
            continue;
        }
        for (i, kx) in KERNEL.iter().enumerate() {
            let xx = x + (i as i64 - 2) * step;
            if xx < 0 || xx >= width {
                continue;
            }
            let tap = (yy * width + xx) as usize;
            let Some(other) = &receivers.samples[tap].surface else { continue };
            let weight = kx * ky * likeness(center, other, plane_slack);
            sum += weight * values[tap];
            total += weight;
        }
    }
    if total > 0.0 { sum / total } else { values[index] }
}

/// 1 for receivers of one plane, normal and color; toward 0 across an edge.
fn likeness(a: &SurfacePoint, b: &SurfacePoint, plane_slack: f32) -> f32 {
    let normals = a.ns.dot(b.ns).max(0.0).powi(NORMAL_EXPONENT);
    let plane = a.ng.dot(b.position - a.position) * plane_slack;
    let albedo = (a.albedo - b.albedo).length_squared() / (ALBEDO_SLACK * ALBEDO_SLACK);
    normals / (1.0 + plane * plane + albedo)
}

#[cfg(test)]
mod tests;

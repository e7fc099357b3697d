//! Repairing the noise of the shadow ratio.
//!
//! In: ratio, receivers · Out: filtered ratio
//! Paper: `[Dammertz10]`; differs: no color guide on the signal itself, a plane distance instead of
//! a position distance. Known failure: shadows finer than the footprint of the first passes blur.

use crate::settings::FilterSettings;
use crate::surface::{PixelSample, Receivers, SurfacePoint};
use rayon::prelude::*;

/// One-dimensional B3 spline.
const KERNEL: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
/// Distance from the receiver's plane that halves a weight's exponent, per metre of depth.
const PLANE_SLACK: f32 = 0.01;
/// 1 / the squared albedo difference that counts as an edge.
const ALBEDO_SCALE: f32 = 1.0 / (0.4 * 0.4);

/// Smooths a per-receiver value along surfaces.
///
/// Shapes: values `[h·w]`; out `[h·w]`
/// Cost:   25 taps a pass and receiver
pub fn atrous(values: &[f32], receivers: &Receivers, settings: &FilterSettings) -> Vec<f32> {
    let guides = Guides::new(receivers);
    let mut current = values.to_vec();
    for pass in 0..settings.passes {
        let mut next = vec![0.0; current.len()];
        next.par_chunks_mut(guides.width).enumerate().for_each_init(
            || RowSums::new(guides.width),
            |sums, (y, out)| filter_row(&guides, &current, y, 1 << pass, sums, out),
        );
        current = next;
    }
    current
}

/// What tells receivers apart, one array per component: the inner loop runs along rows.
struct Guides {
    width: usize,
    height: usize,
    position: [Vec<f32>; 3],
    /// Zero where there is no surface, so that its weight is zero.
    normal: [Vec<f32>; 3],
    albedo: [Vec<f32>; 3],
    /// 1 / (slack · depth).
    plane_scale: Vec<f32>,
}

impl Guides {
    fn new(receivers: &Receivers) -> Self {
        let component = |get: &(dyn Fn(&SurfacePoint) -> f32 + Sync)| -> Vec<f32> {
            let of = |s: &PixelSample| s.surface.as_ref().map_or(0.0, get);
            receivers.samples.par_iter().map(of).collect()
        };
        let scale = |s: &PixelSample| 1.0 / (PLANE_SLACK * s.depth.abs().clamp(1e-4, 1e6));
        Self {
            width: receivers.width,
            height: receivers.height,
            position: std::array::from_fn(|a| component(&|s| s.position[a])),
            normal: std::array::from_fn(|a| component(&|s| s.ns[a])),
            albedo: std::array::from_fn(|a| component(&|s| s.albedo[a])),
            plane_scale: receivers.samples.par_iter().map(scale).collect(),
        }
    }
}

/// Weighted sums of one row.
struct RowSums {
    sum: Vec<f32>,
    total: Vec<f32>,
}

impl RowSums {
    fn new(width: usize) -> Self {
        Self { sum: vec![0.0; width], total: vec![0.0; width] }
    }
}

fn filter_row(
    guides: &Guides,
    values: &[f32],
    y: usize,
    step: usize,
    sums: &mut RowSums,
    out: &mut [f32],
) {
    sums.sum.fill(0.0);
    sums.total.fill(0.0);
    let width = guides.width;
    for (j, ky) in KERNEL.iter().enumerate() {
        let Some(tap_y) = (y + j * step).checked_sub(2 * step).filter(|&t| t < guides.height)
        else {
            continue;
        };
        for (i, kx) in KERNEL.iter().enumerate() {
            // Columns whose tap i·step − 2·step lies inside the picture.
            let first = (2 * step).saturating_sub(i * step).min(width);
            let last = (width + 2 * step).saturating_sub(i * step).min(width);
            if first >= last {
                continue;
            }
            let tap_x = first + i * step - 2 * step;
            let (center, tap) = (y * width + first, tap_y * width + tap_x);
            let (sum, total) = (&mut sums.sum[first..last], &mut sums.total[first..last]);
            let kernel = kx * ky;
            add_taps(guides, values, [center, tap], kernel, 1.0 / step as f32, sum, total);
        }
    }
    for (x, out) in out.iter_mut().enumerate() {
        let total = sums.total[x];
        *out = if total > 0.0 { sums.sum[x] / total } else { values[y * width + x] };
    }
}

/// Adds one tap to a run of receivers, compiled for AVX2 where the processor has it.
fn add_taps(
    guides: &Guides,
    values: &[f32],
    starts: [usize; 2],
    kernel: f32,
    plane_step: f32,
    sum: &mut [f32],
    total: &mut [f32],
) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { add_taps_avx2(guides, values, starts, kernel, plane_step, sum, total) };
    }
    add_taps_lanes(guides, values, starts, kernel, plane_step, sum, total);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn add_taps_avx2(
    guides: &Guides,
    values: &[f32],
    starts: [usize; 2],
    kernel: f32,
    plane_step: f32,
    sum: &mut [f32],
    total: &mut [f32],
) {
    add_taps_lanes(guides, values, starts, kernel, plane_step, sum, total);
}

#[inline(always)]
fn add_taps_lanes(
    guides: &Guides,
    values: &[f32],
    [center, tap]: [usize; 2],
    kernel: f32,
    plane_step: f32,
    sum: &mut [f32],
    total: &mut [f32],
) {
    let n = sum.len();
    let total = &mut total[..n];
    let value = &values[tap..tap + n];
    let [px, py, pz] = runs(&guides.position, center, n);
    let [qx, qy, qz] = runs(&guides.position, tap, n);
    let [nx, ny, nz] = runs(&guides.normal, center, n);
    let [mx, my, mz] = runs(&guides.normal, tap, n);
    let [ar, ag, ab] = runs(&guides.albedo, center, n);
    let [br, bg, bb] = runs(&guides.albedo, tap, n);
    let scale = &guides.plane_scale[center..center + n];
    for i in 0..n {
        let cos = nx[i] * mx[i] + ny[i] * my[i] + nz[i] * mz[i];
        let cos = if cos > 0.0 { cos } else { 0.0 };
        // cos³².
        let cos_sq = cos * cos;
        let cos_4 = cos_sq * cos_sq;
        let cos_8 = cos_4 * cos_4;
        let normals = (cos_8 * cos_8) * (cos_8 * cos_8);
        let plane = nx[i] * (qx[i] - px[i]) + ny[i] * (qy[i] - py[i]) + nz[i] * (qz[i] - pz[i]);
        let plane = plane * scale[i] * plane_step;
        let (dr, dg, db) = (ar[i] - br[i], ag[i] - bg[i], ab[i] - bb[i]);
        let albedo = (dr * dr + dg * dg + db * db) * ALBEDO_SCALE;
        let weight = kernel * normals / (1.0 + plane * plane + albedo);
        sum[i] += weight * value[i];
        total[i] += weight;
    }
}

/// The same run of three components.
#[inline(always)]
fn runs(components: &[Vec<f32>; 3], start: usize, n: usize) -> [&[f32]; 3] {
    [0, 1, 2].map(|axis| &components[axis][start..start + n])
}

#[cfg(test)]
mod tests;

//! Repairing the noise of the shadow ratio.
//!
//! In: ratio, receivers · Out: filtered ratio
//! Papers: `[Dammertz10]`, `[Schied17]`; differs: a plane distance instead of a position distance,
//! and the variance of the signal comes from its mean, as that of a share of a few rays.
//! Known failure: where a few rays cannot tell two shadows apart, their edge blurs.

use crate::settings::FilterSettings;
use crate::surface::{PixelSample, Receivers, SurfacePoint};
use rayon::prelude::*;

/// One-dimensional B3 spline.
const KERNEL: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
/// Distance from the receiver's plane that halves a weight, per metre of depth.
const PLANE_SLACK: f32 = 0.01;
/// 1 / the squared albedo difference that halves a weight: another material is likely another
/// surface, where normals and planes do not tell.
const ALBEDO_SCALE: f32 = 1.0 / (0.4 * 0.4);

/// How many standard deviations apart two ratios halve each other's weight.
const RATIO_SLACK: f32 = 1.5;
/// Variance of a ratio of one ray that is all seen or all hidden in its surroundings: what it may
/// be although none of them says so.
const LEAST_VARIANCE: f32 = 0.005;

/// Smooths the share of `rays` rays per receiver that arrived along surfaces, up to where it
/// changes more than its noise explains.
///
/// Shapes: ratio `[h·w]`; out `[h·w]`
/// Cost:   25 taps a pass and receiver, and a pass for the first guess of the variance
pub fn atrous(
    ratio: &[f32],
    rays: u32,
    receivers: &Receivers,
    settings: &FilterSettings,
) -> Vec<f32> {
    let guides = Guides::new(receivers);
    let raw = Signal { value: ratio.to_vec(), variance: vec![1.0; ratio.len()] };
    let unknown = Signal { value: vec![0.0; ratio.len()], variance: vec![0.0; ratio.len()] };
    // A first guess, blind to changes of the ratio, tells the variance of a share p of n rays:
    // p (1 − p) / n.
    let mut guess = pass(&guides, &raw, &unknown, 1);
    let share = |p: f32| (p * (1.0 - p)).max(LEAST_VARIANCE) / rays.max(1) as f32;
    let variance: Vec<f32> = guess.value.iter().map(|&p| share(p)).collect();
    guess.variance.iter_mut().zip(&variance).for_each(|(left, v)| *left *= v);
    let mut current = pass(&guides, &Signal { variance, ..raw }, &guess, 1);
    for i in 1..settings.passes {
        current = pass(&guides, &current, &current, 1 << i);
    }
    current.value
}

/// A noisy value per receiver.
struct Signal {
    value: Vec<f32>,
    variance: Vec<f32>,
}

/// One pass with taps `step` receivers apart. Receivers are compared by `guess`, as far as its
/// variance tells.
fn pass(guides: &Guides, signal: &Signal, guess: &Signal, step: usize) -> Signal {
    let width = guides.width;
    let mut out = Signal { value: signal.value.clone(), variance: signal.variance.clone() };
    let rows = out.value.par_chunks_mut(width).zip(out.variance.par_chunks_mut(width));
    rows.enumerate().for_each_init(
        || RowSums::new(width),
        |sums, (y, row)| filter_row(&Inputs { guides, signal, guess }, [y, step], sums, row),
    );
    out
}

/// What a pass reads.
struct Inputs<'a> {
    guides: &'a Guides,
    signal: &'a Signal,
    guess: &'a Signal,
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
    value: Vec<f32>,
    variance: Vec<f32>,
    total: Vec<f32>,
}

impl RowSums {
    fn new(width: usize) -> Self {
        Self { value: vec![0.0; width], variance: vec![0.0; width], total: vec![0.0; width] }
    }
}

/// One tap of the kernel for a run of receivers.
#[derive(Clone, Copy)]
struct Tap {
    /// First receiver of the run, and the one that it reads.
    center: usize,
    tap: usize,
    /// Columns of the run in the row.
    columns: [usize; 2],
    kernel: f32,
    /// 1 / distance of the taps, pixels.
    inverse_step: f32,
}

fn filter_row(
    inputs: &Inputs,
    [y, step]: [usize; 2],
    sums: &mut RowSums,
    (value, variance): (&mut [f32], &mut [f32]),
) {
    for sum in [&mut sums.value, &mut sums.variance, &mut sums.total] {
        sum.fill(0.0);
    }
    let (width, height) = (inputs.guides.width, inputs.guides.height);
    for (j, ky) in KERNEL.iter().enumerate() {
        let Some(tap_y) = (y + j * step).checked_sub(2 * step).filter(|&t| t < height) else {
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
            let tap = Tap {
                center: y * width + first,
                tap: tap_y * width + tap_x,
                columns: [first, last],
                kernel: kx * ky,
                inverse_step: 1.0 / step as f32,
            };
            add_tap(inputs, tap, sums);
        }
    }
    // Where there is no surface, the old values stay.
    for x in (0..width).filter(|&x| sums.total[x] > 0.0) {
        value[x] = sums.value[x] / sums.total[x];
        variance[x] = sums.variance[x] / (sums.total[x] * sums.total[x]);
    }
}

/// Adds one tap to a run of receivers, compiled for AVX2 where the processor has it.
fn add_tap(inputs: &Inputs, tap: Tap, sums: &mut RowSums) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { add_tap_avx2(inputs, tap, sums) };
    }
    add_tap_lanes(inputs, tap, sums);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn add_tap_avx2(inputs: &Inputs, tap: Tap, sums: &mut RowSums) {
    add_tap_lanes(inputs, tap, sums);
}

#[inline(always)]
fn add_tap_lanes(inputs: &Inputs, tap: Tap, sums: &mut RowSums) {
    let Inputs { guides, signal, guess } = inputs;
    let Tap { center, tap, columns: [first, last], kernel, inverse_step } = tap;
    let n = last - first;
    let sum = &mut sums.value[first..last];
    let variance_sum = &mut sums.variance[first..last];
    let total = &mut sums.total[first..last];
    let [px, py, pz] = runs(&guides.position, center, n);
    let [qx, qy, qz] = runs(&guides.position, tap, n);
    let [nx, ny, nz] = runs(&guides.normal, center, n);
    let [mx, my, mz] = runs(&guides.normal, tap, n);
    let [ar, ag, ab] = runs(&guides.albedo, center, n);
    let [br, bg, bb] = runs(&guides.albedo, tap, n);
    let scale = &guides.plane_scale[center..center + n];
    let (value, variance) = (&signal.value[tap..tap + n], &signal.variance[tap..tap + n]);
    let (here, there) = (&guess.value[center..center + n], &guess.value[tap..tap + n]);
    let noise_here = &guess.variance[center..center + n];
    let noise_there = &guess.variance[tap..tap + n];
    for i in 0..n {
        let cos = nx[i] * mx[i] + ny[i] * my[i] + nz[i] * mz[i];
        let cos = if cos > 0.0 { cos } else { 0.0 };
        // cos³².
        let cos_sq = cos * cos;
        let cos_4 = cos_sq * cos_sq;
        let cos_8 = cos_4 * cos_4;
        let normals = (cos_8 * cos_8) * (cos_8 * cos_8);
        let plane = nx[i] * (qx[i] - px[i]) + ny[i] * (qy[i] - py[i]) + nz[i] * (qz[i] - pz[i]);
        let plane = plane * scale[i] * inverse_step;
        let (dr, dg, db) = (ar[i] - br[i], ag[i] - bg[i], ab[i] - bb[i]);
        let albedo = (dr * dr + dg * dg + db * db) * ALBEDO_SCALE;
        let change = here[i] - there[i];
        let noise = RATIO_SLACK * RATIO_SLACK * (noise_here[i] + noise_there[i]) + 1e-12;
        let edges = 1.0 + plane * plane + albedo + change * change / noise;
        let weight = kernel * normals / edges;
        sum[i] += weight * value[i];
        variance_sum[i] += weight * weight * variance[i];
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

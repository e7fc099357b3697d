//! Putting together what the pixels of interleaved sampling know.
//!
//! In: irradiances, each of another part of the lights · Out: irradiances of all lights
//! Paper: `[KellerHeidrich01]`; differs: weighted by planes and shading normals, and the window
//! stays inside the picture.
//! Known failure: what is smaller than a few pixels is smoothed, and where a surface shows fewer
//! pixels than there are parts, some parts are missing.

#[cfg(feature = "gpu")]
pub mod gpu;

use super::guides;
use super::planes::Planes;
use super::sweep::{NORMAL, PLANE_SCALE, POSITION};
use crate::gather::Gathered;
use crate::math::luminance;
use crate::surface::{Receivers, ViewFrame};
use glam::Vec3;
use rayon::prelude::*;

/// Most trust in what one part of the lights says about all.
const MOST_TRUST: f32 = 8.0;

/// Means over windows of `side` × `side` pixels, each part of the lights as often as every other
/// where all lie in one plane; the trust in a ratio becomes that in a share of the whole light.
///
/// Shapes: receivers `[h·w]` · Cost: (side + 1)² taps a receiver
pub fn join(gathers: &mut [&mut Gathered], receivers: &Receivers, view: &ViewFrame, side: u32) {
    if side < 2 || receivers.samples.is_empty() {
        return;
    }
    let guides = guides(receivers, view);
    for gathered in gathers {
        let joined = join_one(&gathered.unshadowed, receivers, &guides, side as usize);
        if gathered.trust.is_empty() {
            gathered.trust = vec![1.0; joined.len()];
        }
        let parts = gathered.unshadowed.iter().zip(&joined);
        for (trust, (part, whole)) in gathered.trust.iter_mut().zip(parts) {
            *trust *= share(*part, *whole);
        }
        gathered.unshadowed = joined;
    }
}

/// Light of a part of the lights as a share of what that of all is taken for.
fn share(part: Vec3, whole: Vec3) -> f32 {
    let whole = luminance(whole);
    if whole > 0.0 { (luminance(part) / whole).min(MOST_TRUST) } else { 1.0 }
}

/// First channel of the shading normals.
const SHADING: usize = 3;

fn join_one(raw: &[Vec3], receivers: &Receivers, guides: &Planes, side: usize) -> Vec<Vec3> {
    let (width, height) = (receivers.width, receivers.height);
    // Irradiance, then shading normal, zero where there is no surface.
    let mut signal = Planes::new(width, height, 6);
    let (pitch, stride) = (signal.pitch(), signal.stride);
    signal.data.par_chunks_mut(pitch).enumerate().for_each(|(y, row)| {
        for (x, i) in (y * width..(y + 1) * width).enumerate() {
            let normal = receivers.samples[i].surface.as_ref().map_or(Vec3::ZERO, |s| s.ns);
            for axis in 0..3 {
                row[axis * stride + x] = raw[i][axis];
                row[(SHADING + axis) * stride + x] = normal[axis];
            }
        }
    });
    let mut out = raw.to_vec();
    let rows = out.par_chunks_mut(width).enumerate().with_min_len(8);
    rows.for_each_init(Vec::new, |sums, (y, out)| {
        sums.clear();
        sums.resize(4 * width, 0.0);
        Window { guides, signal: &signal, side }.sum_row(y, sums);
        let (sums, totals) = sums.split_at(3 * width);
        for (x, out) in out.iter_mut().enumerate().filter(|(x, _)| totals[*x] > 0.0) {
            let sum = Vec3::from_array([0, 1, 2].map(|axis| sums[axis * width + x]));
            *out = sum / totals[x];
        }
    });
    out
}

/// A window that moves over the picture.
struct Window<'a> {
    guides: &'a Planes,
    signal: &'a Planes,
    side: usize,
}

/// A run of receivers and one tap of each.
#[derive(Clone, Copy)]
struct Run {
    center: [usize; 2],
    tap: [usize; 2],
    n: usize,
    /// Weight of the tap in the window.
    kernel: f32,
}

/// The middle of a window of some side, moved so that it does not leave 0…size.
fn middle(at: usize, size: usize, side: usize) -> usize {
    let half = side / 2;
    if size > side { at.clamp(half, size - 1 - half) } else { at }
}

impl Window<'_> {
    /// Sums of red, green, blue and of the weights for every receiver of a row.
    fn sum_row(&self, y: usize, sums: &mut [f32]) {
        let Self { side, .. } = *self;
        let (width, height, half) = (self.guides.width, self.guides.height, side / 2);
        // One more tap than parts: the outer two are of the same part.
        let weight = |i: usize| if i == 0 || i == side { 0.5 } else { 1.0 };
        for j in 0..=side {
            let tap_y = middle(y, height, side) + j;
            let Some(tap_y) = tap_y.checked_sub(half).filter(|&y| y < height) else { continue };
            for i in 0..=side {
                let kernel = weight(i) * weight(j);
                let mut add = |x: usize, n: usize| {
                    let tap_x = middle(x, width, side) + i;
                    let Some(tap_x) = tap_x.checked_sub(half).filter(|&x| x < width) else {
                        return;
                    };
                    let run = Run { center: [x, y], tap: [tap_x, tap_y], n, kernel };
                    self.add(run, sums);
                };
                let inner = if width > side { half..width - half } else { 0..0 };
                (0..inner.start).chain(inner.end..width).for_each(|x| add(x, 1));
                if !inner.is_empty() {
                    add(inner.start, inner.len());
                }
            }
        }
    }

    fn add(&self, Run { center, tap, n, kernel }: Run, sums: &mut [f32]) {
        let (guides, signal, width) = (self.guides, self.signal, self.guides.width);
        let runs = |channel: usize, at| [0, 1, 2].map(|axis| guides.run(channel + axis, at, n));
        let ([px, py, pz], [qx, qy, qz]) = (runs(POSITION, center), runs(POSITION, tap));
        let [nx, ny, nz] = runs(NORMAL, center);
        let shading = |at| [0, 1, 2].map(|axis| signal.run(SHADING + axis, at, n));
        let ([sx, sy, sz], [tx, ty, tz]) = (shading(center), shading(tap));
        let slack = guides.run(PLANE_SCALE, center, n);
        let inverse_step = 2.0 / self.side as f32;
        let [r, g, b] = [0, 1, 2].map(|axis| signal.run(axis, tap, n));
        let mut sums = sums.chunks_exact_mut(width).map(|row| &mut row[center[0]..center[0] + n]);
        let mut next = || sums.next().unwrap_or_default();
        let (red, green, blue, total) = (next(), next(), next(), next());
        for i in 0..n {
            let cos = sx[i] * tx[i] + sy[i] * ty[i] + sz[i] * tz[i];
            let cos = if cos > 0.0 { cos } else { 0.0 };
            let cos_sq = cos * cos;
            let (dx, dy, dz) = (qx[i] - px[i], qy[i] - py[i], qz[i] - pz[i]);
            let plane = (nx[i] * dx + ny[i] * dy + nz[i] * dz) * (slack[i] * inverse_step);
            let weight = kernel * (cos_sq * cos_sq) / (1.0 + plane * plane);
            red[i] += weight * r[i];
            green[i] += weight * g[i];
            blue[i] += weight * b[i];
            total[i] += weight;
        }
    }
}

#[cfg(test)]
mod tests;

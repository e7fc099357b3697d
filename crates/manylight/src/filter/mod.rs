//! Repairing the noise of shadow ratios.
//!
//! In: ratios, receivers · Out: filtered ratios
//! Papers: `[Dammertz10]`, `[Schied17]`; differs: 3 × 3 taps, a plane distance instead of a
//! position distance, and the variance of the signal comes from its mean, as that of a share of a
//! few rays.
//! Known failure: where a few rays cannot tell two shadows apart, their edge blurs.

#[cfg(feature = "gpu")]
pub mod gpu;
pub mod interleave;
mod planes;
mod sweep;
pub mod temporal;

use crate::math::luminance;
use crate::settings::FilterSettings;
use crate::surface::{Receivers, ViewFrame};
use glam::Vec2;
use planes::Planes;
use rayon::prelude::*;
use sweep::{By, Pass, Scratch, sweep_row};

/// Distance from the receiver's plane that halves a weight, in pixels at its depth for every pixel
/// between the two.
const PLANE_SLACK: f32 = 0.25;
/// What positions are off by, as a share of their distance from the world's origin or the eye.
const ROUNDING: f32 = 4.0 * f32::EPSILON;
/// Least trust: what failed to draw anything is likely in the dark itself.
const LEAST_TRUST: f32 = 0.05;
/// Variance of a ratio of one ray that is all seen or all hidden in its surroundings: what it may
/// be although none of them says so.
const LEAST_VARIANCE: f32 = 0.005;

/// Shares of light that arrived, as a few rays per receiver tell them.
#[derive(Clone, Copy, Debug)]
pub struct Noisy<'a> {
    /// One share per receiver, 0…1.
    pub ratio: &'a [f32],
    /// What each counts beside its neighbors; empty if all the same.
    pub trust: &'a [f32],
    /// Frames behind each of them; empty if one.
    pub frames: &'a [f32],
    /// Rays behind each of them in every frame.
    pub rays: u32,
}

/// Smooths shares along surfaces, up to where they change more than their noise explains.
///
/// Several at once cost less than one after the other: surfaces weigh them alike.
///
/// Shapes: each ratio `[h·w]`; out, one for each, `[h·w]`
/// Cost:   9 taps a pass and receiver, and a pass for the first guess of the variance
pub fn atrous(
    noisy: &[Noisy<'_>],
    receivers: &Receivers,
    view: &ViewFrame,
    settings: &FilterSettings,
) -> Vec<Vec<f32>> {
    if noisy.is_empty() {
        return Vec::new();
    }
    let guides = guides(receivers, view);
    let mut current = first_pass(noisy, &guides);
    for i in 1..settings.passes {
        let (by, step) = (By::Themselves, 1 << i);
        current = Pass { guides: &guides, signals: &current, by, step }.run();
    }
    (0..noisy.len()).map(|signal| current.channel(2 * signal)).collect()
}

/// The pass that has to guess the variance.
fn first_pass(noisy: &[Noisy<'_>], guides: &Planes) -> Planes {
    let (mut raw, trust) = raw(noisy, guides);
    // A first guess, blind to changes of the ratio, tells the variance of a share p of n rays:
    // p (1 − p) / n.
    let blind = By::Nothing { trust: &trust };
    let mut guess = Pass { guides, signals: &raw, by: blind, step: 1 }.run();
    let (width, stride, pitch) = (guides.width, guides.stride, raw.pitch());
    let rows = guess.data.par_chunks_mut(pitch).zip(raw.data.par_chunks_mut(pitch));
    rows.enumerate().for_each(|(y, (guess, raw))| {
        let signals = guess.chunks_exact_mut(2 * stride).zip(raw.chunks_exact_mut(2 * stride));
        for ((guess, raw), noisy) in signals.zip(noisy) {
            let ((value, shrunk), raw) = (guess.split_at_mut(stride), &mut raw[stride..]);
            let rays = noisy.rays.max(1) as f32;
            let frames = noisy.frames.get(y * width..(y + 1) * width);
            for (x, ((p, shrunk), variance)) in value.iter().zip(shrunk).zip(raw).enumerate() {
                let frames = frames.and_then(|frames| frames.get(x)).copied().unwrap_or(1.0);
                *variance = (*p * (1.0 - *p)).max(LEAST_VARIANCE) * (1.0 / (rays * frames));
                *shrunk *= *variance;
            }
        }
    });
    let by = By::Guess { trust: &trust, guess: &guess };
    Pass { guides, signals: &raw, by, step: 1 }.run()
}

impl Pass<'_> {
    /// All rows.
    fn run(&self) -> Planes {
        let Planes { width, height, channels, .. } = *self.signals;
        let mut out = Planes::new(width, height, channels);
        let mut rows: Vec<_> = out.data.chunks_mut(self.signals.pitch()).enumerate().collect();
        // Rows that share taps follow one another.
        rows.sort_by_key(|(y, _)| (y % self.step, *y));
        rows.into_par_iter().with_min_len(8).for_each_init(
            || Scratch::new(channels / 2),
            |scratch, (y, row)| sweep_row(self, y, scratch, row),
        );
        out
    }
}

/// Value and variance of every share, the variance 1; and the trust in it.
fn raw(noisy: &[Noisy<'_>], guides: &Planes) -> (Planes, Planes) {
    let (width, height, stride) = (guides.width, guides.height, guides.stride);
    let mut raw = Planes::new(width, height, 2 * noisy.len());
    let mut trust = Planes::new(width, height, noisy.len());
    let (pitch, trust_pitch) = (raw.pitch(), trust.pitch());
    let rows = raw.data.par_chunks_mut(pitch).zip(trust.data.par_chunks_mut(trust_pitch));
    rows.enumerate().for_each(|(y, (raw, trust))| {
        let pixels = y * width..(y + 1) * width;
        let rows = raw.chunks_exact_mut(2 * stride).zip(trust.chunks_exact_mut(stride));
        for ((raw, trust), noisy) in rows.zip(noisy) {
            raw[..width].copy_from_slice(&noisy.ratio[pixels.clone()]);
            raw[stride..].fill(1.0);
            match noisy.trust.get(pixels.clone()) {
                None => trust.fill(1.0),
                Some(known) => {
                    let pairs = trust.iter_mut().zip(known);
                    pairs.for_each(|(trust, known)| *trust = known.max(LEAST_TRUST));
                }
            }
        }
    });
    (raw, trust)
}

/// What tells receivers apart: position, normal, luminance of the albedo, 1 / plane slack. The
/// normal is the geometric one: bumps of a normal map lie in one shadow. It is zero where there is
/// no surface, and with it every weight.
fn guides(receivers: &Receivers, view: &ViewFrame) -> Planes {
    let mut guides = Planes::new(receivers.width, receivers.height, sweep::GUIDES);
    let (width, stride, pitch) = (guides.width, guides.stride, guides.pitch());
    // Seen from the eye, what is near has small numbers, and products of planes keep their digits.
    let origin = view.ray(Vec2::new(width as f32, receivers.height as f32) * 0.5).origin;
    let rows = guides.data.par_chunks_mut(pitch).zip(receivers.samples.par_chunks(width));
    rows.for_each(|(row, samples)| {
        for (x, sample) in samples.iter().enumerate() {
            let Some(surface) = &sample.surface else { continue };
            let slack = PLANE_SLACK * view.pixel_size(sample.depth).clamp(1e-7, 1e6);
            let (p, n) = (surface.position - origin, surface.ng);
            let slack = slack + ROUNDING * surface.position.abs().max(p.abs()).max_element();
            let guides = [p.x, p.y, p.z, n.x, n.y, n.z, luminance(surface.albedo), 1.0 / slack];
            for (guide, row) in guides.into_iter().zip(row.chunks_exact_mut(stride)) {
                row[x] = guide;
            }
        }
    });
    guides
}

#[cfg(test)]
mod tests;

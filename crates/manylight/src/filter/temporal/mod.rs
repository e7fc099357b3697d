//! Shadow ratios of earlier frames, found again where their surfaces are seen now.
//!
//! In: ratios, receivers, views of a sequence · Out: ratios that count several frames
//! Papers: `[Schied17]`; differs: trust weighs frames as it weighs neighbors, history is clamped to
//! what a few rays leave possible, and clamped history counts less.
//! Limits: the world stands still; what moves is taken for what was there before it.
//! Known failure: a shadow that changes by less than its noise lags behind.

#[cfg(feature = "gpu")]
pub mod gpu;

use super::planes::Planes;
use super::sweep::{By, Pass};
use super::{LEAST_TRUST, Noisy, ROUNDING, guides, raw};
use crate::settings::FilterSettings;
use crate::surface::{Receivers, SurfacePoint, ViewFrame};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Distance from the receiver's plane up to which something was the same surface, in pixels.
const PLANE_PIXELS: f32 = 1.0;
/// Cosine of geometric normals above which something was the same surface.
const NORMAL_COS: f32 = 0.9;
/// Least weight of all taps of the last frame: with less of them there is no history.
const LEAST_TAPS: f32 = 0.01;
/// How many standard deviations of a share history may be away from the mean around it. Above √3,
/// a lone receiver, which is a quarter of that mean, is not clamped for being alone.
const CLAMP: f32 = 2.0;

/// A share of rays over several frames.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Share {
    ratio: f32,
    trust: f32,
    frames: f32,
}

/// One signal over several frames.
///
/// Shapes: `[h·w]` each
#[derive(Clone, Debug, Default)]
pub struct Accumulated {
    /// Share of light that arrives, 0…1.
    pub ratio: Vec<f32>,
    /// What each counts beside its neighbors.
    pub trust: Vec<f32>,
    /// Frames behind each of them, 1 … `filter.history`.
    pub frames: Vec<f32>,
    /// Rays behind each of them in every frame.
    pub rays: u32,
}

impl Accumulated {
    /// As the filter takes it.
    pub fn noisy(&self) -> Noisy<'_> {
        let Self { ratio, trust, frames, rays } = self;
        Noisy { ratio, trust, frames, rays: *rays }
    }

    fn share(&self, index: usize) -> Share {
        let (ratio, trust) = (self.ratio[index], self.trust[index]);
        Share { ratio, trust, frames: self.frames[index] }
    }
}

/// The last frame.
#[derive(Clone, Debug)]
struct Frame {
    view: ViewFrame,
    offset_px: Vec2,
    /// Position and geometric normal.
    surfaces: Vec<Option<(Vec3, Vec3)>>,
    signals: Vec<Accumulated>,
}

/// What a sequence remembers from frame to frame; the caller's, one per sequence.
#[derive(Clone, Debug, Default)]
pub struct History {
    last: Option<Frame>,
}

impl History {
    /// Forgets everything, as at a cut.
    pub fn clear(&mut self) {
        self.last = None;
    }
}

/// Adds a frame's shares to those of earlier frames, which the result then is.
///
/// Signals keep their places from frame to frame; frames need seeds of their own. What was seen at
/// another size or with other signals or numbers of rays is forgotten.
///
/// Shapes: each ratio `[h·w]`; out, one for each
/// Cost:   9 taps a receiver, and 4 of the last frame
pub fn accumulate<'h>(
    noisy: &[Noisy<'_>],
    receivers: &Receivers,
    view: &ViewFrame,
    offset_px: Vec2,
    history: &'h mut History,
    settings: &FilterSettings,
) -> &'h [Accumulated] {
    if noisy.is_empty() {
        history.clear();
        return &[];
    }
    let size = [view.width, view.height];
    let is_like = |last: &Frame| {
        let rays = last.signals.iter().map(|signal| signal.rays);
        [last.view.width, last.view.height] == size && rays.eq(noisy.iter().map(|n| n.rays))
    };
    let last = history.last.take().filter(is_like);
    let taps = |surface: &SurfacePoint| last.as_ref().and_then(|last| last.find_taps(surface));
    let taps: Vec<Option<Taps>> =
        receivers.samples.par_iter().map(|s| s.surface.as_ref().and_then(taps)).collect();
    let around = neighborhoods(noisy, &guides(receivers, view));
    let most = settings.history.max(1) as f32;
    let signal = |(s, (noisy, around)): (usize, (&Noisy<'_>, &Vec<Neighborhood>))| {
        let share = |i: usize| {
            let trust = noisy.trust.get(i).map_or(1.0, |trust| trust.max(LEAST_TRUST));
            let now = Share { ratio: noisy.ratio[i], trust, frames: 1.0 };
            let (Some(last), Some(taps)) = (&last, &taps[i]) else { return now };
            let history = rectify(taps.recall(&last.signals[s]), around[i]);
            // What is no number is forgotten, or it would stay.
            let is_number = history.ratio.is_finite() && history.trust.is_finite();
            if is_number { blend(now, history, most) } else { now }
        };
        let shares: Vec<Share> = (0..taps.len()).into_par_iter().map(share).collect();
        Accumulated {
            ratio: shares.iter().map(|share| share.ratio).collect(),
            trust: shares.iter().map(|share| share.trust).collect(),
            frames: shares.iter().map(|share| share.frames).collect(),
            rays: noisy.rays,
        }
    };
    let signals = noisy.iter().zip(&around).enumerate().map(signal).collect();
    let surfaces = receivers.samples.iter().map(|s| s.surface.as_ref().map(|s| (s.position, s.ng)));
    let surfaces = surfaces.collect();
    &history.last.insert(Frame { view: *view, offset_px, surfaces, signals }).signals
}

/// Receivers of the last frame around a point, and their weights; the sum of these is 1.
#[derive(Clone, Copy, Debug)]
struct Taps {
    index: [usize; 4],
    weight: [f32; 4],
}

impl Frame {
    /// Where a surface was seen: the four nearest receivers, those on other surfaces left out.
    fn find_taps(&self, surface: &SurfacePoint) -> Option<Taps> {
        let (p, ng) = (surface.position, surface.ng);
        let point = self.view.project(p)? - self.offset_px;
        let (width, height) = (self.view.width as i32, self.view.height as i32);
        // Far outside, before numbers become too large for whole ones.
        let (least, most) = (Vec2::NEG_ONE, Vec2::new(width as f32, height as f32));
        if !(point.cmpgt(least).all() && point.cmplt(most).all()) {
            return None;
        }
        let corner = point.floor();
        let share = point - corner;
        let slack = PLANE_PIXELS * self.view.pixel_size(self.view.depth(p)).clamp(1e-7, 1e6)
            + ROUNDING * p.abs().max_element();
        let mut taps = Taps { index: [0; 4], weight: [0.0; 4] };
        for tap in 0..4 {
            let [x, y] = [tap as i32 % 2, tap as i32 / 2];
            let (tap_x, tap_y) = (corner.x as i32 + x, corner.y as i32 + y);
            if tap_x < 0 || tap_y < 0 || tap_x >= width || tap_y >= height {
                continue;
            }
            let index = (tap_y * width + tap_x) as usize;
            let Some((seen, normal)) = self.surfaces[index] else { continue };
            if ng.dot(normal) > NORMAL_COS && ng.dot(seen - p).abs() < slack {
                let along = |share: f32, far: i32| if far == 1 { share } else { 1.0 - share };
                taps.index[tap] = index;
                taps.weight[tap] = along(share.x, x) * along(share.y, y);
            }
        }
        let total: f32 = taps.weight.iter().sum();
        taps.weight = taps.weight.map(|weight| weight / total);
        (total > LEAST_TAPS).then_some(taps)
    }
}

impl Taps {
    /// The mean of a signal at the taps, in proportion to trust.
    fn recall(&self, signal: &Accumulated) -> Share {
        let (mut ratio, mut trust, mut frames) = (0.0, 0.0, 0.0);
        for (&index, &weight) in self.index.iter().zip(&self.weight) {
            let share = signal.share(index);
            ratio += weight * share.trust * share.ratio;
            trust += weight * share.trust;
            frames += weight * share.frames;
        }
        Share { ratio: ratio / trust, trust, frames }
    }
}

/// What shares around a receiver say: their mean, and how far from it history may be.
#[derive(Clone, Copy, Debug)]
struct Neighborhood {
    mean: f32,
    slack: f32,
}

impl Neighborhood {
    /// From the mean of shares of some rays, of their squares, and the sum of squared weights.
    fn new(mean: f32, mean_sq: f32, weights_sq: f32, rays: f32) -> Self {
        // Some rays that all tell the same leave a little of the other possible: a ray of either
        // kind is added to them.
        let count = rays / weights_sq;
        let p = (mean * count + 1.0) / (count + 2.0);
        let variance = (mean_sq - mean * mean).max(p * (1.0 - p) / rays);
        Self { mean, slack: CLAMP * variance.max(0.0).sqrt() }
    }
}

/// The neighborhoods of every receiver, for every signal.
fn neighborhoods(noisy: &[Noisy<'_>], guides: &Planes) -> Vec<Vec<Neighborhood>> {
    let squares: Vec<Vec<f32>> =
        noisy.iter().map(|n| n.ratio.iter().map(|ratio| ratio * ratio).collect()).collect();
    let pair = |(noisy, squares)| [noisy, Noisy { ratio: squares, ..noisy }];
    let squares = squares.iter().map(Vec::as_slice);
    let pairs: Vec<Noisy<'_>> = noisy.iter().copied().zip(squares).flat_map(pair).collect();
    let (signals, trust) = raw(&pairs, guides);
    let by = By::Nothing { trust: &trust };
    let sums = Pass { guides, signals: &signals, by, step: 1 }.run();
    let of_signal = |(s, noisy): (usize, &Noisy<'_>)| {
        let [mean, weights_sq, mean_sq] = [0, 1, 2].map(|channel| sums.channel(4 * s + channel));
        let rays = noisy.rays.max(1) as f32;
        let shares = mean.iter().zip(&mean_sq).zip(&weights_sq);
        shares.map(|((&m, &sq), &w)| Neighborhood::new(m, sq, w, rays)).collect()
    };
    noisy.iter().enumerate().map(of_signal).collect()
}

/// Clamps history to what is possible now; the further it was away the fewer frames it counts.
fn rectify(history: Share, around: Neighborhood) -> Share {
    let change = history.ratio - around.mean;
    if change.abs() <= around.slack {
        return history;
    }
    let share = around.slack / change.abs();
    let ratio = around.mean + change * share;
    Share { ratio, frames: (history.frames * share * share).max(1.0), ..history }
}

/// Adds a frame to history: every frame weighs the same up to the most, then the oldest fade.
fn blend(now: Share, history: Share, most: f32) -> Share {
    let before = history.frames.min(most - 1.0);
    let total = history.trust * before + now.trust;
    let ratio = (history.ratio * history.trust * before + now.ratio * now.trust) / total;
    Share { ratio, trust: total / (before + 1.0), frames: before + 1.0 }
}

#[cfg(test)]
mod tests;

//! One row of one pass.

use super::planes::Planes;

/// Channels of the guides: position, normal, albedo, 1 / plane slack.
pub(super) const GUIDES: usize = 8;
pub(super) const POSITION: usize = 0;
pub(super) const NORMAL: usize = 3;
const ALBEDO: usize = 6;
pub(super) const PLANE_SCALE: usize = 7;

/// Receivers that are worked on at once: their sums and guides fit the nearest cache.
const RUN: usize = 128;
/// Weights along an axis: passes of doubling steps add up to a tent.
pub(super) const KERNEL: [f32; 3] = [0.25, 0.5, 0.25];
/// 1 / the squared difference of albedos that halves a weight: another material is likely another
/// surface, where normals and planes do not tell.
pub(super) const ALBEDO_SCALE: f32 = 1.0 / (0.4 * 0.4);
/// How many standard deviations apart two ratios halve each other's weight.
pub(super) const RATIO_SLACK: f32 = 1.5;
/// Keeps a quotient of two zeros away.
pub(super) const LEAST_NOISE: f32 = 1e-12;

/// What receivers are compared by besides their surfaces, as far as its variance tells. Trust is
/// what each value counts.
#[derive(Clone, Copy)]
pub(super) enum By<'a> {
    Nothing { trust: &'a Planes },
    Guess { trust: &'a Planes, guess: &'a Planes },
    Themselves,
}

/// One pass.
pub(super) struct Pass<'a> {
    pub guides: &'a Planes,
    /// Value and variance of each signal, in turn.
    pub signals: &'a Planes,
    pub by: By<'a>,
    /// Receivers from one tap to the next.
    pub step: usize,
}

type Run = [f32; RUN];

/// One signal at the receivers of a run.
#[derive(Clone)]
struct Sums {
    value: Run,
    variance: Run,
    total: Run,
    /// What the receiver itself adds to the squared change that halves a weight.
    noise: Run,
}

/// Memory that a thread keeps from row to row.
pub(super) struct Scratch {
    sums: Vec<Sums>,
    /// Of one tap: kernel · normals, and 1 + the squared distances of planes and colors.
    weight: Run,
    edges: Run,
    /// The plane of every receiver: normal over slack, and its product with the position.
    plane: [Run; 4],
}

impl Scratch {
    pub fn new(signals: usize) -> Self {
        let zero = [0.0; RUN];
        let sums = vec![Sums { value: zero, variance: zero, total: zero, noise: zero }; signals];
        Self { sums, weight: zero, edges: zero, plane: [zero; 4] }
    }
}

/// Filters row `y` into `out`, compiled for AVX2 where the processor has it.
pub(super) fn sweep_row(pass: &Pass<'_>, y: usize, scratch: &mut Scratch, out: &mut [f32]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has AVX2.
        return unsafe { sweep_row_avx2(pass, y, scratch, out) };
    }
    sweep_row_lanes(pass, y, scratch, out);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sweep_row_avx2(pass: &Pass<'_>, y: usize, scratch: &mut Scratch, out: &mut [f32]) {
    sweep_row_lanes(pass, y, scratch, out);
}

#[inline(always)]
fn sweep_row_lanes(pass: &Pass<'_>, y: usize, scratch: &mut Scratch, out: &mut [f32]) {
    let (width, height, step) = (pass.guides.width, pass.guides.height, pass.step);
    for start in (0..width).step_by(RUN) {
        let n = RUN.min(width - start);
        pass.begin([start, y], n, scratch);
        for (j, ky) in KERNEL.iter().enumerate() {
            let Some(tap_y) = (y + j * step).checked_sub(step).filter(|&t| t < height) else {
                continue;
            };
            for (i, kx) in KERNEL.iter().enumerate() {
                if [i, j] == [1, 1] {
                    continue;
                }
                // Columns whose tap lies inside the picture.
                let first = start.max(step.saturating_sub(i * step));
                let last = (start + n).min((width + step).saturating_sub(i * step));
                if first >= last {
                    continue;
                }
                let tap = Tap {
                    center: [first, y],
                    tap: [first + i * step - step, tap_y],
                    n: last - first,
                    offset: first - start,
                };
                tap.weigh(pass.guides, kx * ky, scratch);
                let signals = pass.signals;
                match pass.by {
                    By::Nothing { trust } => tap.add_blind(signals, trust, scratch),
                    By::Guess { trust, guess } => {
                        tap.add(signals, guess, Some(trust), scratch);
                    }
                    By::Themselves => tap.add(signals, signals, None, scratch),
                }
            }
        }
        pass.end([start, y], n, scratch, out);
    }
}

impl Pass<'_> {
    /// Starts the sums with the receivers themselves.
    #[inline(always)]
    fn begin(&self, at: [usize; 2], n: usize, scratch: &mut Scratch) {
        let [px, py, pz] = runs(self.guides, POSITION, at, n);
        let [nx, ny, nz] = runs(self.guides, NORMAL, at, n);
        let slack = self.guides.run(PLANE_SCALE, at, n);
        let [x, y, z, w] = scratch.plane.each_mut().map(|run| &mut run[..n]);
        let inverse_step = 1.0 / self.step as f32;
        for i in 0..n {
            let scale = slack[i] * inverse_step;
            (x[i], y[i], z[i]) = (nx[i] * scale, ny[i] * scale, nz[i] * scale);
            w[i] = x[i] * px[i] + y[i] * py[i] + z[i] * pz[i];
        }
        let (guess, trust) = match self.by {
            By::Nothing { trust } => (self.signals, Some(trust)),
            By::Guess { trust, guess } => (guess, Some(trust)),
            By::Themselves => (self.signals, None),
        };
        for (signal, sums) in scratch.sums.iter_mut().enumerate() {
            let value = self.signals.run(2 * signal, at, n);
            let variance = self.signals.run(2 * signal + 1, at, n);
            let known = guess.run(2 * signal + 1, at, n);
            let trust = trust.map_or(&[1.0; RUN][..n], |trust| trust.run(signal, at, n));
            let (sum, variance_sum) = (&mut sums.value[..n], &mut sums.variance[..n]);
            let (total, noise) = (&mut sums.total[..n], &mut sums.noise[..n]);
            for i in 0..n {
                let weight = if slack[i] > 0.0 { KERNEL[1] * KERNEL[1] * trust[i] } else { 0.0 };
                sum[i] = weight * value[i];
                variance_sum[i] = weight * weight * variance[i];
                total[i] = weight;
                noise[i] = RATIO_SLACK * RATIO_SLACK * known[i] + LEAST_NOISE;
            }
        }
    }

    /// Writes the means; where there is no surface, the old values.
    #[inline(always)]
    fn end(&self, at: [usize; 2], n: usize, scratch: &Scratch, out: &mut [f32]) {
        let stride = self.signals.stride;
        for (signal, sums) in scratch.sums.iter().enumerate() {
            let old = self.signals.run(2 * signal, at, n);
            let old_variance = self.signals.run(2 * signal + 1, at, n);
            let (values, variances) = out[2 * signal * stride..].split_at_mut(stride);
            let (values, variances) = (&mut values[at[0]..][..n], &mut variances[at[0]..][..n]);
            let (sum, variance_sum) = (&sums.value[..n], &sums.variance[..n]);
            let total = &sums.total[..n];
            for i in 0..n {
                let found = total[i] > 0.0;
                let total = if found { total[i] } else { 1.0 };
                values[i] = if found { sum[i] / total } else { old[i] };
                let variance = variance_sum[i] / (total * total);
                variances[i] = if found { variance } else { old_variance[i] };
            }
        }
    }
}

/// One tap of the kernel for a run of receivers.
#[derive(Clone, Copy)]
struct Tap {
    /// First receiver of the run, and the one that it reads.
    center: [usize; 2],
    tap: [usize; 2],
    /// Length of the run, and where it starts in the scratch memory.
    n: usize,
    offset: usize,
}

impl Tap {
    /// What surfaces alone say about the weight.
    #[inline(always)]
    fn weigh(self, guides: &Planes, kernel: f32, scratch: &mut Scratch) {
        let Self { center, tap, n, offset } = self;
        let [qx, qy, qz] = runs(guides, POSITION, tap, n);
        let [nx, ny, nz] = runs(guides, NORMAL, center, n);
        let [mx, my, mz] = runs(guides, NORMAL, tap, n);
        let (here, there) = (guides.run(ALBEDO, center, n), guides.run(ALBEDO, tap, n));
        let [x, y, z, w] = scratch.plane.each_ref().map(|run| &run[offset..offset + n]);
        let (weight, edges) = (&mut scratch.weight[..n], &mut scratch.edges[..n]);
        for i in 0..n {
            let cos = nx[i] * mx[i] + ny[i] * my[i] + nz[i] * mz[i];
            let cos = if cos > 0.0 { cos } else { 0.0 };
            let cos_sq = cos * cos;
            weight[i] = kernel * (cos_sq * cos_sq);
            let plane = x[i] * qx[i] + y[i] * qy[i] + z[i] * qz[i] - w[i];
            let albedo = here[i] - there[i];
            edges[i] = 1.0 + plane * plane + albedo * albedo * ALBEDO_SCALE;
        }
    }

    /// Adds the tap of every signal.
    #[inline(always)]
    fn add(self, signals: &Planes, guess: &Planes, trust: Option<&Planes>, scratch: &mut Scratch) {
        let Self { center, tap, n, offset } = self;
        let (normals, edges) = (&scratch.weight[..n], &scratch.edges[..n]);
        for (signal, sums) in scratch.sums.iter_mut().enumerate() {
            let value = signals.run(2 * signal, tap, n);
            let variance = signals.run(2 * signal + 1, tap, n);
            let (here, there) = (guess.run(2 * signal, center, n), guess.run(2 * signal, tap, n));
            let noise_there = guess.run(2 * signal + 1, tap, n);
            let noise_here = &sums.noise[offset..offset + n];
            let sum = &mut sums.value[offset..offset + n];
            let variance_sum = &mut sums.variance[offset..offset + n];
            let total = &mut sums.total[offset..offset + n];
            let trust = trust.map_or(&[1.0; RUN][..n], |trust| trust.run(signal, tap, n));
            for i in 0..n {
                let change = here[i] - there[i];
                let noise = noise_here[i] + RATIO_SLACK * RATIO_SLACK * noise_there[i];
                // normals / (edges + change² / noise), with one division.
                let weight = normals[i] * noise / (edges[i] * noise + change * change) * trust[i];
                sum[i] += weight * value[i];
                variance_sum[i] += weight * weight * variance[i];
                total[i] += weight;
            }
        }
    }

    /// The same, blind to changes of the signals.
    #[inline(always)]
    fn add_blind(self, signals: &Planes, trust: &Planes, scratch: &mut Scratch) {
        let Self { tap, n, offset, .. } = self;
        let (normals, edges) = (&scratch.weight[..n], &scratch.edges[..n]);
        for (signal, sums) in scratch.sums.iter_mut().enumerate() {
            let value = signals.run(2 * signal, tap, n);
            let variance = signals.run(2 * signal + 1, tap, n);
            let sum = &mut sums.value[offset..offset + n];
            let variance_sum = &mut sums.variance[offset..offset + n];
            let total = &mut sums.total[offset..offset + n];
            let trust = trust.run(signal, tap, n);
            for i in 0..n {
                let weight = normals[i] / edges[i] * trust[i];
                sum[i] += weight * value[i];
                variance_sum[i] += weight * weight * variance[i];
                total[i] += weight;
            }
        }
    }
}

/// The same run of three channels.
#[inline(always)]
fn runs(planes: &Planes, first: usize, at: [usize; 2], n: usize) -> [&[f32]; 3] {
    [0, 1, 2].map(|axis| planes.run(first + axis, at, n))
}

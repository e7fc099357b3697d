//! The filters of FLIP: what the eye blurs and what it notices.
//!
//! In: YCxCz pixels. Out: blurred YCxCz; strengths of edges and points.
//! Papers: [Andersson20, Sec. 4.1–4.2].
//! Limits: separable passes; the border repeats.

use std::f32::consts::PI;

use rayon::prelude::*;

use super::color::Rgb;

/// One tap of four filters at once.
type Taps = [f32; 4];

/// Contrast sensitivity of the eye per opponent channel: amplitude a and width b of Gaussians
/// a·√(π/b)·exp(−π²x²/b), x in degrees; Cz has two [Andersson20, Table 1].
const SENSITIVITY: [(f32, f32); 4] = [(1.0, 0.0047), (1.0, 0.0053), (34.1, 0.04), (13.5, 0.025)];
/// The widest b, which sets the radius of all.
const WIDEST: f32 = 0.04;
/// The width of the features that the eye detects, degrees [Andersson20, Sec. 4.2].
const FEATURE_WIDTH: f32 = 0.082;

/// Blurs each opponent channel by the eye's contrast sensitivity.
pub(super) struct ColorFilter {
    taps: Vec<Taps>,
    /// Shares of the two Gaussians of Cz.
    cz_weights: [f32; 2],
}

impl ColorFilter {
    /// Builds the taps for a resolution.
    pub(super) fn new(pixels_per_degree: f32) -> Self {
        let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * pixels_per_degree).ceil() as i32;
        let gaussian = |b: f32, i: i32| {
            let x = i as f32 / pixels_per_degree;
            (-PI * PI * x * x / b).exp()
        };
        let sums =
            SENSITIVITY.map(|(_, b)| (-radius..=radius).map(|i| gaussian(b, i)).sum::<f32>());
        let tap =
            |i: i32| std::array::from_fn(|lane| gaussian(SENSITIVITY[lane].1, i) / sums[lane]);
        // A square filter's sum is that of its rows squared.
        let volume = |lane: usize| {
            let (a, b) = SENSITIVITY[lane];
            a * (PI / b).sqrt() * sums[lane] * sums[lane]
        };
        let total = volume(2) + volume(3);
        Self {
            taps: (-radius..=radius).map(tap).collect(),
            cz_weights: [volume(2) / total, volume(3) / total],
        }
    }

    /// What the eye resolves of YCxCz pixels.
    pub(super) fn apply(&self, image: &[Rgb], width: usize) -> Vec<Rgb> {
        let rows = convolve_rows(image, width, &self.taps, |sum, tap, [y, cx, cz]| {
            let lanes = [y, cx, cz, cz];
            std::array::from_fn(|lane| sum[lane] + tap[lane] * lanes[lane])
        });
        let blurred = convolve_columns(&rows, width, &self.taps, |sum, tap, lanes| {
            std::array::from_fn(|lane| sum[lane] + tap[lane] * lanes[lane])
        });
        let [wide, narrow] = self.cz_weights;
        blurred.into_par_iter().map(|[y, cx, c1, c2]| [y, cx, wide * c1 + narrow * c2]).collect()
    }
}

/// Measures edges and points by derivatives of a Gaussian.
pub(super) struct FeatureFilter {
    /// Gaussian, first derivative, second derivative; the fourth lane is empty.
    taps: Vec<Taps>,
}

impl FeatureFilter {
    /// Builds the taps for a resolution.
    pub(super) fn new(pixels_per_degree: f32) -> Self {
        let deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let radius = (3.0 * deviation).ceil() as i32;
        let raw = |i: i32| {
            let x = i as f32;
            let gaussian = (-x * x / (2.0 * deviation * deviation)).exp();
            let curvature = x * x / (deviation * deviation) - 1.0;
            [gaussian, -x * gaussian, curvature * gaussian, 0.0]
        };
        let sum_by = |sign: f32, lane: usize| -> f32 {
            (-radius..=radius).map(|i| (sign * raw(i)[lane]).max(0.0)).sum()
        };
        // Positive weights sum to 1, negative ones to −1.
        let normalize = |i: i32| {
            let taps = raw(i);
            std::array::from_fn(|lane| match taps[lane] {
                0.0 => 0.0,
                weight => weight / sum_by(weight.signum(), lane),
            })
        };
        Self { taps: (-radius..=radius).map(normalize).collect() }
    }

    /// The strength of edges and of points in the Y of YCxCz pixels.
    pub(super) fn apply(&self, image: &[Rgb], width: usize) -> Vec<[f32; 2]> {
        let rows = convolve_rows(image, width, &self.taps, |sum, tap, [y, ..]| {
            let y = (y + 16.0) / 116.0;
            std::array::from_fn(|lane| sum[lane] + tap[lane] * y)
        });
        let columns = convolve_columns(&rows, width, &self.taps, |sum, tap, [blur, d, dd, _]| {
            let ([g, g1, g2, _], [dx, dy, dxx, dyy]) = (tap, sum);
            [dx + g * d, dy + g1 * blur, dxx + g * dd, dyy + g2 * blur]
        });
        columns.into_par_iter().map(|[dx, dy, dxx, dyy]| [dx.hypot(dy), dxx.hypot(dyy)]).collect()
    }
}

/// Sums taps along rows.
fn convolve_rows(
    image: &[Rgb],
    width: usize,
    taps: &[Taps],
    add: impl Fn(Taps, Taps, Rgb) -> Taps + Sync,
) -> Vec<Taps> {
    let radius = taps.len() / 2;
    let mut out = vec![[0.0; 4]; image.len()];
    out.par_chunks_exact_mut(width).zip(image.par_chunks_exact(width)).for_each(|(out, row)| {
        for (x, out) in out.iter_mut().enumerate() {
            *out = taps.iter().enumerate().fold([0.0; 4], |sum, (i, &tap)| {
                let source = (x + i).saturating_sub(radius).min(width - 1);
                add(sum, tap, row[source])
            });
        }
    });
    out
}

/// Sums taps along columns.
fn convolve_columns(
    image: &[Taps],
    width: usize,
    taps: &[Taps],
    add: impl Fn(Taps, Taps, Taps) -> Taps + Sync,
) -> Vec<Taps> {
    let radius = taps.len() / 2;
    let height = image.len() / width;
    let mut out = vec![[0.0; 4]; image.len()];
    out.par_chunks_exact_mut(width).enumerate().for_each(|(y, out)| {
        // Add whole rows, so that memory is read in order.
        for (i, &tap) in taps.iter().enumerate() {
            let source = (y + i).saturating_sub(radius).min(height - 1);
            let row = &image[source * width..][..width];
            for (out, &value) in out.iter_mut().zip(row) {
                *out = add(*out, tap, value);
            }
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constant_pictures_stay_and_have_no_features() {
        let image = vec![[50.0, 20.0, -30.0]; 7 * 5];
        for pixel in ColorFilter::new(67.0).apply(&image, 7) {
            assert!(pixel.iter().zip(image[0]).all(|(a, b)| (a - b).abs() < 1e-3));
        }
        for features in FeatureFilter::new(67.0).apply(&image, 7) {
            assert!(features.iter().all(|value| *value < 1e-5));
        }
    }

    #[test]
    fn a_step_is_an_edge_of_its_height() {
        let image: Vec<Rgb> =
            (0..60 * 3).map(|i| [if i % 60 < 30 { -16.0 } else { 100.0 }, 0.0, 0.0]).collect();
        let features = FeatureFilter::new(67.0).apply(&image, 60);
        let edge = features[60 + 30][0];
        assert!((edge - 1.0).abs() < 0.2, "{edge}");
        assert!(features[60][0] < 1e-5);
    }
}

//! FLIP: the difference a viewer sees when flipping between two pictures.
//!
//! In: linear Rec.709 pictures of one shape. Out: error maps in 0..1.
//! Papers: `[Andersson20]` for low, `[Andersson21]` for high dynamic range.
//! Limits: always [`PIXELS_PER_DEGREE`]; the filters end at the border by repeating its pixels.

use rayon::prelude::*;

use super::color::{
    Rgb, hunt_lab_from_linear, hyab, linear_from_ycxcz, tone_map_aces, ycxcz_from_linear,
};
use super::error::check_pair;
use super::filter::{ColorFilter, FeatureFilter};
use crate::color::bound;
use crate::{Error, Raster, luminance};

/// The viewer's resolution: a 0.7 m wide display of 3840 pixels seen from 0.7 m.
///
/// Source: [Andersson20, Sec. 4.1]: distance · pixels / width · π / 180.
pub(super) const PIXELS_PER_DEGREE: f32 = 0.7 * 3840.0 / 0.7 * std::f32::consts::PI / 180.0;

/// Exponents q_c and q_f of the colour and the feature difference [Andersson20, Sec. 4].
const COLOR_EXPONENT: f32 = 0.7;
const FEATURE_EXPONENT: f32 = 0.5;
/// p_c and p_t: the share of the largest colour difference that is mapped to a share of 0..1.
const COLOR_KNEE: f32 = 0.4;
const COLOR_KNEE_VALUE: f32 = 0.95;
/// Display level that the brightest and the median pixel reach at the ends of the exposure
/// range [Andersson21, Sec. 4].
const EXPOSURE_LEVEL: f64 = 0.85;
/// Most exposures of HDR-FLIP: more than the range of a half float.
const MAX_EXPOSURES: usize = 48;

/// The LDR-FLIP error map of two linear pictures whose 0..1 is what a screen shows.
///
/// Values outside 0..1 are clamped, NaN is black; one channel counts as grey.
///
/// Shapes:  a, b [h·w·1|3]; out [h·w·1], 0 (same) to 1
/// Errors:  Mismatch, Shape
/// Source:  `[Andersson20]`
pub fn flip_ldr(a: &Raster, b: &Raster) -> Result<Raster, Error> {
    check_pair(a, b)?;
    let filters = Filters::new();
    let screen = |rgb: Rgb| rgb.map(|value| bound(value, 1.0));
    let data = filters.eval(a, &gather_pixels(a, screen), &gather_pixels(b, screen));
    Ok(Raster { channels: 1, data, ..*a })
}

/// The HDR-FLIP error map of `a` against the reference `b`: the largest LDR-FLIP error over a
/// range of exposures that the reference chooses.
///
/// Pixels that are not finite in either picture count as black in both, negative values as 0.
///
/// Shapes:  a, b [h·w·1|3]; out [h·w·1], 0 (same) to 1
/// Errors:  Mismatch, Shape
/// Cost:    one LDR-FLIP per stop between the reference's median and maximum, at least two
/// Source:  `[Andersson21]`; differs: at most 48 exposures
pub fn flip_hdr(a: &Raster, b: &Raster) -> Result<Raster, Error> {
    check_pair(a, b)?;
    let (light_a, light_b) = gather_finite_pairs(a, b);
    let filters = Filters::new();
    let mut largest = vec![0.0f32; light_a.len()];
    for ev in choose_exposures(&light_b) {
        let expose = |light: &[Rgb]| -> Vec<Rgb> {
            let scale = ev.exp2();
            light.par_iter().map(|rgb| rgb.map(|value| tone_map_aces(value * scale))).collect()
        };
        let map = filters.eval(a, &expose(&light_a), &expose(&light_b));
        largest.par_iter_mut().zip(map).for_each(|(largest, error)| *largest = largest.max(error));
    }
    Ok(Raster { channels: 1, data: largest, ..*a })
}

/// The exposures of HDR-FLIP, in stops [Andersson21, Sec. 4].
fn choose_exposures(reference: &[Rgb]) -> Vec<f32> {
    // x with ACES(x) = 0.85: the larger root of a quadratic, whose coefficients are the curve's.
    let (a, b, c) = super::color::aces_quadratic(EXPOSURE_LEVEL);
    let bright = (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);

    let mut luminances: Vec<f32> = reference.iter().map(|&rgb| luminance(rgb)).collect();
    luminances.sort_unstable_by(f32::total_cmp);
    let middle = luminances.len() / 2;
    let median = match luminances.len() % 2 {
        1 => luminances[middle],
        _ => (luminances[middle - 1] + luminances[middle]) * 0.5,
    };
    let stop_of = |level: f32| (bright / f64::from(level.clamp(f32::EPSILON, 1e30))).log2() as f32;
    let start = stop_of(luminances[luminances.len() - 1]);
    let stop = stop_of(median);
    let count = ((stop - start).ceil() as usize).clamp(2, MAX_EXPOSURES);
    (0..count).map(|i| start + (stop - start) * i as f32 / (count - 1) as f32).collect()
}

/// The pixels of a raster as colours.
fn gather_pixels(raster: &Raster, convert: impl Fn(Rgb) -> Rgb + Sync) -> Vec<Rgb> {
    let channels = raster.channels;
    let color = |pixel: &[f32]| convert([0, 1, 2].map(|c| pixel[c % channels]));
    raster.data.par_chunks_exact(channels).map(color).collect()
}

/// The light of two pictures, black in both where either is not finite.
fn gather_finite_pairs(a: &Raster, b: &Raster) -> (Vec<Rgb>, Vec<Rgb>) {
    let light = |rgb: Rgb| rgb.map(|value| if value.is_finite() { value.max(0.0) } else { value });
    let (mut light_a, mut light_b) = (gather_pixels(a, light), gather_pixels(b, light));
    light_a.par_iter_mut().zip(&mut light_b).for_each(|(a, b)| {
        if !a.iter().chain(b.iter()).all(|value| value.is_finite()) {
            (*a, *b) = ([0.0; 3], [0.0; 3]);
        }
    });
    (light_a, light_b)
}

/// Both pipelines of FLIP, made once.
struct Filters {
    color: ColorFilter,
    feature: FeatureFilter,
    /// The largest colour difference: between pure green and pure blue.
    color_max: f32,
}

impl Filters {
    fn new() -> Self {
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(hunt_lab_from_linear);
        Self {
            color: ColorFilter::new(PIXELS_PER_DEGREE),
            feature: FeatureFilter::new(PIXELS_PER_DEGREE),
            color_max: hyab(green, blue).powf(COLOR_EXPONENT),
        }
    }

    /// The error of each pixel between two pictures on the screen.
    fn eval(&self, shape: &Raster, a: &[Rgb], b: &[Rgb]) -> Vec<f32> {
        let width = shape.width;
        let opponent = |screen: &[Rgb]| -> Vec<Rgb> {
            screen.par_iter().map(|&rgb| ycxcz_from_linear(rgb)).collect()
        };
        let (a, b) = (opponent(a), opponent(b));
        let [lab_a, lab_b] = [&a, &b].map(|image| {
            let mut seen = self.color.apply(image, width);
            seen.par_iter_mut().for_each(|color| {
                let linear = linear_from_ycxcz(*color).map(|value| value.clamp(0.0, 1.0));
                *color = hunt_lab_from_linear(linear);
            });
            seen
        });
        let [features_a, features_b] = [&a, &b].map(|image| self.feature.apply(image, width));

        (0..a.len())
            .into_par_iter()
            .map(|i| {
                let color = self.rescale_color(hyab(lab_a[i], lab_b[i]).powf(COLOR_EXPONENT));
                let ([edge_a, point_a], [edge_b, point_b]) = (features_a[i], features_b[i]);
                let feature = (edge_a - edge_b).abs().max((point_a - point_b).abs());
                let feature = (feature * std::f32::consts::FRAC_1_SQRT_2).powf(FEATURE_EXPONENT);
                color.powf(1.0 - feature.min(1.0))
            })
            .collect()
    }

    /// Maps colour differences to 0..1, most of the room for the small ones.
    fn rescale_color(&self, difference: f32) -> f32 {
        let knee = COLOR_KNEE * self.color_max;
        if difference < knee {
            return difference * COLOR_KNEE_VALUE / knee;
        }
        let above = (difference - knee) / (self.color_max - knee);
        (COLOR_KNEE_VALUE + above * (1.0 - COLOR_KNEE_VALUE)).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::random_raster;

    const WIDTH: usize = 64;
    const HEIGHT: usize = 48;

    /// The pictures that the reference numbers below were made from.
    fn pattern(i: f64) -> Raster {
        let mut raster = Raster::new(WIDTH, HEIGHT, 3);
        for (index, pixel) in raster.data.chunks_exact_mut(3).enumerate() {
            let (x, y) = ((index % WIDTH) as f64, (index / WIDTH) as f64);
            let checker = ((index % WIDTH / 8 + index / WIDTH / 8) % 2) as f64;
            let r = 0.5 + 0.5 * (0.31 * x + 0.17 * y * (1.0 + 0.1 * i) + i).sin();
            let g = 0.5 + 0.5 * (0.23 * y - 0.11 * x + 0.7 * i).cos();
            let b = checker * 0.8 + 0.1 * (0.5 * x * y / 40.0).sin();
            pixel.copy_from_slice(&[r, g, b].map(|value| value.clamp(0.0, 1.0) as f32));
        }
        raster
    }

    fn change(raster: &Raster, f: impl Fn(f32) -> f32) -> Raster {
        Raster { data: raster.data.iter().map(|&value| f(value)).collect(), ..*raster }
    }

    fn mean(map: Result<Raster, Error>) -> f64 {
        let map = map.unwrap();
        assert!(map.data.iter().all(|value| (0.0..=1.0).contains(value)));
        map.data.iter().map(|&value| f64::from(value)).sum::<f64>() / map.data.len() as f64
    }

    fn close(mean: f64, expected: f64) {
        assert!((mean - expected).abs() < 2e-3, "{mean} is not {expected}");
    }

    // The reference numbers are from the authors' flip-evaluator 1.7, at its defaults.

    #[test]
    fn ldr_means_match_the_authors() {
        let (a, b) = (pattern(0.0), pattern(1.0));
        close(mean(flip_ldr(&b, &a)), 0.777_769);
        let darker = change(&a, |value| (value * 0.95 + 0.01).clamp(0.0, 1.0));
        close(mean(flip_ldr(&darker, &a)), 0.125_020);
        let white = change(&a, |_| 1.0);
        close(mean(flip_ldr(&white, &change(&a, |_| 0.0))), 0.967_365);
    }

    #[test]
    fn hdr_means_match_the_authors() {
        let hdr = |raster: &Raster| change(raster, |v| (f64::from(v).powi(4) * 50.0 + 0.02) as f32);
        let (a, b) = (pattern(0.0), pattern(1.0));
        close(mean(flip_hdr(&hdr(&b), &hdr(&a))), 0.855_976);
        let darker = change(&a, |value| (value * 0.95 + 0.01).clamp(0.0, 1.0));
        close(mean(flip_hdr(&hdr(&darker), &hdr(&a))), 0.154_359);
        let exposures = choose_exposures(&gather_pixels(&hdr(&a), |rgb| rgb));
        assert_eq!(exposures.len(), 3);
        assert!((exposures[0] + 4.501_811).abs() < 1e-3, "{exposures:?}");
        assert!((exposures[2] + 2.130_756).abs() < 1e-3, "{exposures:?}");
    }

    #[test]
    fn order_does_not_matter_and_runs_repeat() {
        let (a, b) = (pattern(0.0), pattern(1.0));
        close(mean(flip_ldr(&a, &b)), mean(flip_ldr(&b, &a)));
        assert_eq!(flip_hdr(&a, &b).unwrap(), flip_hdr(&a, &b).unwrap());
        assert_eq!(mean(flip_ldr(&a, &a)), 0.0);
    }

    #[test]
    fn odd_pictures_have_errors_in_range() {
        let black = Raster::new(5, 4, 3);
        let bright = change(&black, |_| f32::MAX);
        let mut odd = random_raster(5, 4, 3, 2);
        odd.data[..3].copy_from_slice(&[f32::NAN, f32::INFINITY, -1.0]);
        let pictures = [black, bright, odd, change(&Raster::new(5, 4, 3), |_| 1e-30)];
        for a in &pictures {
            for b in &pictures {
                mean(flip_ldr(a, b));
                mean(flip_hdr(a, b));
            }
        }
        let pixel = Raster { width: 1, height: 1, channels: 1, data: vec![0.5] };
        assert_eq!(mean(flip_hdr(&pixel, &pixel)), 0.0);
    }
}

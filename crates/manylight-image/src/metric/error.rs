//! Error numbers.

use crate::error::check_raster;
use crate::{Error, Raster, flip_hdr, luminance};

/// The errors of a picture `a` against a reference `b`.
///
/// With c over channels and M = mean over finite pixels; a reference that is black throughout
/// gives infinite relative errors, or zero when `a` is black too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// mean over c of M((a−b)² / (b² + 0.01·M(b)²)).
    pub rel_mse: f64,
    /// √M((a−b)²) over all channels.
    pub rmse: f64,
    /// √M((Y(a)−Y(b))²) / M(Y(b)), with luminance Y.
    pub relative_rmse: f64,
    /// mean over c of M(|a−b| / (|b| + 0.01·|M(b)|)).
    pub mape: f64,
    /// M(a−b) / M(b) over all channels: positive when `a` is too bright.
    pub energy_bias: f64,
    /// Mean of the HDR-FLIP map, 0 (same) to 1.
    pub flip_mean: f64,
    /// 99th percentile of the HDR-FLIP map.
    pub flip_p99: f64,
    /// Pixels left out because either picture has NaN or ±∞ there.
    pub nonfinite_count: usize,
}

/// Regularises relative errors in the dark, as a share of the mean.
const DARK: f64 = 0.01;

/// All errors of `a` against the reference `b`, HDR-FLIP included.
///
/// Errors: `Mismatch` when shapes differ, `Shape` when they are inconsistent.
/// Cost: FLIP dominates, some 100 ns per pixel, exposure and core.
pub fn compare(a: &Raster, b: &Raster) -> Result<Errors, Error> {
    check_pair(a, b)?;
    let sums = Sums::collect(a, b);
    let (mut square, mut difference, mut level) = (0.0, 0.0, 0.0);
    let (mut square_y, mut level_y) = (0.0, 0.0);
    for (pixel_a, pixel_b) in finite_pixels(a, b) {
        for (&a, &b) in pixel_a.iter().zip(pixel_b) {
            let (a, b) = (f64::from(a), f64::from(b));
            square += (a - b) * (a - b);
            difference += a - b;
            level += b;
        }
        let (y_a, y_b) = (f64::from(pixel_luminance(pixel_a)), f64::from(pixel_luminance(pixel_b)));
        square_y += (y_a - y_b) * (y_a - y_b);
        level_y += y_b;
    }
    let count = sums.count as f64;
    let values = count * a.channels as f64;
    let map = flip_hdr(a, b)?;
    let (flip_mean, flip_p99) = summarize(&map);
    Ok(Errors {
        rel_mse: sums.rel_mse,
        rmse: divide(square, values).sqrt(),
        relative_rmse: divide(divide(square_y, count).sqrt(), divide(level_y, count).abs()),
        mape: sums.mape,
        energy_bias: divide(difference, level),
        flip_mean,
        flip_p99,
        nonfinite_count: a.width * a.height - sums.count,
    })
}

/// The relMSE of [`Errors`] alone, for loops that cannot afford FLIP.
///
/// Errors: `Mismatch` when shapes differ, `Shape` when they are inconsistent.
pub fn compute_rel_mse(a: &Raster, b: &Raster) -> Result<f64, Error> {
    check_pair(a, b)?;
    Ok(Sums::collect(a, b).rel_mse)
}

/// Refuses pictures of different or impossible shapes.
pub(super) fn check_pair(a: &Raster, b: &Raster) -> Result<(), Error> {
    check_raster(a)?;
    check_raster(b)?;
    let shape = |raster: &Raster| [raster.width, raster.height, raster.channels];
    let (a, b) = (shape(a), shape(b));
    if a == b { Ok(()) } else { Err(Error::Mismatch { a, b }) }
}

/// The relative errors, which need the mean of the reference first.
struct Sums {
    rel_mse: f64,
    mape: f64,
    count: usize,
}

impl Sums {
    fn collect(a: &Raster, b: &Raster) -> Self {
        let mut mean = [0.0; 3];
        let mut count = 0;
        for (_, pixel_b) in finite_pixels(a, b) {
            count += 1;
            for (mean, &value) in mean.iter_mut().zip(pixel_b) {
                *mean += f64::from(value);
            }
        }
        let mean = mean.map(|sum| sum / (count.max(1)) as f64);
        let (mut rel_square, mut rel_abs) = (0.0, 0.0);
        for (pixel_a, pixel_b) in finite_pixels(a, b) {
            for ((&a, &b), mean) in pixel_a.iter().zip(pixel_b).zip(mean) {
                let (a, b) = (f64::from(a), f64::from(b));
                rel_square += divide((a - b) * (a - b), b * b + DARK * mean * mean);
                rel_abs += divide((a - b).abs(), b.abs() + DARK * mean.abs());
            }
        }
        let values = (count * a.channels) as f64;
        Self { rel_mse: divide(rel_square, values), mape: divide(rel_abs, values), count }
    }
}

/// The pairs of pixels that are finite in both pictures.
fn finite_pixels<'a>(a: &'a Raster, b: &'a Raster) -> impl Iterator<Item = (&'a [f32], &'a [f32])> {
    let finite = |pixel: &[f32]| pixel.iter().all(|value| value.is_finite());
    a.data
        .chunks_exact(a.channels)
        .zip(b.data.chunks_exact(b.channels))
        .filter(move |(a, b)| finite(a) && finite(b))
}

/// The luminance of a pixel; a single channel is its own.
fn pixel_luminance(pixel: &[f32]) -> f32 {
    match *pixel {
        [r, g, b] => luminance([r, g, b]),
        [value, ..] => value,
        [] => 0.0,
    }
}

/// A quotient where 0/0 is 0.
fn divide(numerator: f64, denominator: f64) -> f64 {
    if numerator == 0.0 { 0.0 } else { numerator / denominator }
}

/// Mean and 99th percentile of an error map.
fn summarize(map: &Raster) -> (f64, f64) {
    let sum: f64 = map.data.iter().map(|&value| f64::from(value)).sum();
    let mut sorted = map.data.clone();
    let rank = ((sorted.len() - 1) as f64 * 0.99).round() as usize;
    let (_, &mut p99, _) = sorted.select_nth_unstable_by(rank, f32::total_cmp);
    (sum / map.data.len() as f64, f64::from(p99))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::random_raster;

    fn grey(values: &[f32]) -> Raster {
        Raster { width: values.len(), height: 1, channels: 1, data: values.to_vec() }
    }

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-6 * b.abs().max(1e-3), "{a} is not {b}");
    }

    #[test]
    fn closed_forms_hold() {
        let errors = compare(&grey(&[2.0, 4.0]), &grey(&[1.0, 3.0])).unwrap();
        close(errors.rmse, 1.0);
        close(errors.relative_rmse, 0.5);
        close(errors.energy_bias, 0.5);
        close(errors.rel_mse, (1.0 / 1.04 + 1.0 / 9.04) / 2.0);
        close(errors.mape, (1.0 / 1.02 + 1.0 / 3.02) / 2.0);
        assert_eq!(errors.nonfinite_count, 0);
    }

    #[test]
    fn three_channels_average_their_relative_errors() {
        let a = Raster { width: 1, height: 1, channels: 3, data: vec![2.0, 2.0, 2.0] };
        let b = Raster { width: 1, height: 1, channels: 3, data: vec![1.0, 2.0, 4.0] };
        let errors = compare(&a, &b).unwrap();
        close(errors.rel_mse, (1.0 / 1.01 + 4.0 / 16.16) / 3.0);
        close(errors.energy_bias, -1.0 / 7.0);
        close(compute_rel_mse(&a, &b).unwrap(), errors.rel_mse);
    }

    #[test]
    fn identity_is_zero_even_in_black() {
        for raster in [random_raster(9, 8, 3, 1), Raster::new(4, 4, 3), grey(&[0.0])] {
            let errors = compare(&raster, &raster).unwrap();
            let all = [errors.rel_mse, errors.rmse, errors.mape, errors.energy_bias];
            assert_eq!(all, [0.0; 4]);
            assert!(errors.flip_mean < 1e-6 && errors.flip_p99 < 1e-6);
        }
        assert!(compare(&grey(&[1.0]), &grey(&[0.0])).unwrap().rel_mse.is_infinite());
    }

    #[test]
    fn nonfinite_pixels_are_counted_and_left_out() {
        let nan = f32::NAN;
        let a = grey(&[2.0, 4.0, nan, 1.0, f32::INFINITY]);
        let b = grey(&[1.0, 3.0, 1.0, nan, f32::INFINITY]);
        let errors = compare(&a, &b).unwrap();
        assert_eq!(errors.nonfinite_count, 3);
        close(errors.rmse, 1.0);
        let errors = compare(&grey(&[nan]), &grey(&[nan])).unwrap();
        assert_eq!((errors.nonfinite_count, errors.rmse, errors.flip_mean), (1, 0.0, 0.0));
    }

    #[test]
    fn different_shapes_are_refused() {
        let error = compare(&Raster::new(2, 2, 3), &Raster::new(2, 3, 3)).unwrap_err();
        assert!(error.to_string().contains("2×3"), "{error}");
        assert!(compare(&Raster::new(2, 2, 3), &Raster::new(2, 2, 1)).is_err());
        assert!(compare(&Raster::new(0, 0, 3), &Raster::new(0, 0, 3)).is_err());
    }
}

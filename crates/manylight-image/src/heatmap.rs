//! False colours for pictures of numbers.
//!
//! In: one channel and the range to show. Out: sRGB bytes.
//! Limits: linear scale only; take logarithms before, if wanted.

use crate::color::bound;
use crate::error::check_raster;
use crate::{Error, Raster};

/// Colour of values that are no numbers.
const NOT_A_NUMBER: [u8; 3] = [255, 0, 255];

/// Inferno, from near black over red to pale yellow, of even perceived lightness; rows are the
/// powers 0 to 6 of red, green and blue.
///
/// Source: van der Walt and Smith 2015 (the map); Zucker 2019, *matplotlib colormaps* (the fit).
const INFERNO: [[f32; 3]; 7] = [
    [0.000_218_940_37, 0.001_651_004_6, -0.019_480_899],
    [0.106_513_42, 0.563_956_44, 3.932_712_4],
    [11.602_493, -3.972_854, -15.942_394],
    [-41.703_996, 17.436_4, 44.354_145],
    [77.162_94, -33.402_36, -81.807_31],
    [-71.319_43, 32.626_064, 73.209_52],
    [25.131_126, -12.242_669, -23.070_325],
];

/// The sRGB bytes, three per pixel, of one channel between `lo` (black) and `hi` (pale yellow).
///
/// Values outside the range, infinities included, take the colour of its nearer end; NaN is
/// magenta. A range that is empty or no number shows values above `lo` as `hi`.
///
/// Errors: `Shape` unless the raster has one channel.
pub fn heatmap(raster: &Raster, lo: f32, hi: f32) -> Result<Vec<u8>, Error> {
    check_raster(raster)?;
    if raster.channels != 1 {
        return Err(Error::shape(raster, "give one channel"));
    }
    Ok(raster.data.iter().flat_map(|&value| color(value, lo, hi)).collect())
}

/// The colour of one value.
fn color(value: f32, lo: f32, hi: f32) -> [u8; 3] {
    if value.is_nan() {
        return NOT_A_NUMBER;
    }
    let t = if value <= lo {
        0.0
    } else if value >= hi || hi - lo <= 0.0 {
        1.0
    } else {
        bound((value - lo) / (hi - lo), 1.0)
    };
    let eval = |c: usize| INFERNO.iter().rev().fold(0.0, |sum, row| sum * t + row[c]);
    [0, 1, 2].map(|c| (eval(c).clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{linear_from_srgb, luminance};

    #[test]
    fn lightness_rises_from_black_to_pale() {
        let mut raster = Raster::new(101, 1, 1);
        for (index, value) in raster.data.iter_mut().enumerate() {
            *value = index as f32;
        }
        let bytes = heatmap(&raster, 0.0, 100.0).unwrap();
        let light = |pixel: &[u8]| {
            luminance([0, 1, 2].map(|c| linear_from_srgb(f32::from(pixel[c]) / 255.0)))
        };
        let lights: Vec<f32> = bytes.chunks(3).map(light).collect();
        assert!(lights.windows(2).all(|pair| pair[1] > pair[0] - 2e-3));
        assert!(lights[0] < 0.01 && lights[100] > 0.8);
    }

    #[test]
    fn odd_values_and_ranges_have_colors() {
        let data = vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.5];
        let raster = Raster { width: 4, height: 1, channels: 1, data };
        let bytes = heatmap(&raster, 0.0, 1.0).unwrap();
        assert_eq!(bytes[..3], NOT_A_NUMBER);
        assert_eq!(bytes[3..6], color(1.0, 0.0, 1.0));
        assert_eq!(bytes[6..9], color(0.0, 0.0, 1.0));
        assert_eq!(heatmap(&raster, 1.0, 1.0).unwrap().len(), 12);
        assert_eq!(heatmap(&raster, f32::NAN, f32::NAN).unwrap().len(), 12);
        assert!(heatmap(&Raster::new(1, 1, 3), 0.0, 1.0).is_err());
    }
}

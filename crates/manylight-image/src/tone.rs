//! From scene-linear light to the eight bits of a screen.
//!
//! In: a linear raster. Out: sRGB bytes.
//! Papers: cited at [`ToneCurve`]; exposure after [Reinhard02, Eq. 1–2].
//! Limits: one exposure for the whole picture; no local adaptation, no dithering.

use rayon::prelude::*;

use crate::color::bound;
use crate::error::check_raster;
use crate::{Error, Raster, luminance, srgb_from_linear};

/// How a picture becomes eight bits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToneSettings {
    /// Stops by which light is amplified; `None` chooses by [`compute_auto_exposure_ev`].
    pub exposure_ev: Option<f32>,
    /// The curve that follows.
    pub curve: ToneCurve,
}

/// A curve from linear light to the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ToneCurve {
    /// AgX: keeps hues and lets bright colours fade to white.
    ///
    /// Source: Sobotka, AgX; matrices and sixth-order fit from Wrensch 2023, *Minimal AgX
    /// Implementation*.
    #[default]
    Agx,
    /// A filmic curve per channel, with more contrast and hue shifts in bright colours.
    ///
    /// Source: Narkowicz 2015, *ACES Filmic Tone Mapping Curve*.
    Aces,
    /// No curve: 1 is white, brighter light clips.
    Linear,
}

/// Light that replaces +∞ and everything brighter, after exposure.
const BRIGHTEST: f32 = 65504.0;
/// Luminance that automatic exposure maps the log-average to.
const MIDDLE_GREY: f64 = 0.18;
/// Share of pixels left out at the dark and at the bright end of automatic exposure.
const TRIM: f64 = 0.1;
/// Most stops that automatic exposure moves.
const MAX_EV: f64 = 24.0;

/// The sRGB bytes of a raster, three per pixel; one channel becomes grey.
///
/// NaN and negative light are black; +∞ is as bright as a half float can be.
///
/// Errors: `Shape` for an inconsistent raster.
pub fn tone_map(raster: &Raster, settings: &ToneSettings) -> Result<Vec<u8>, Error> {
    check_raster(raster)?;
    let ev = settings.exposure_ev.unwrap_or_else(|| compute_auto_exposure_ev(raster));
    let scale = if ev.is_nan() { 1.0 } else { ev.exp2() };
    let mut out = vec![0; raster.width * raster.height * 3];
    let row_len = raster.width * 3;
    out.par_chunks_exact_mut(row_len)
        .zip(raster.data.par_chunks_exact(raster.width * raster.channels))
        .for_each(|(out, row)| {
            for (out, pixel) in out.chunks_exact_mut(3).zip(row.chunks_exact(raster.channels)) {
                let rgb = [0, 1, 2].map(|c| bound(pixel[c % raster.channels] * scale, BRIGHTEST));
                for (out, code) in out.iter_mut().zip(settings.curve.eval(rgb)) {
                    *out = (code * 255.0 + 0.5) as u8;
                }
            }
        });
    Ok(out)
}

/// The stops that bring a picture's typical luminance to middle grey.
///
/// Why not the plain log-average: skies, lamps and black corners would rule it. Only positive
/// finite pixels count, and of these the middle four fifths.
///
/// Units: stops, within ±24; 0 when no pixel shines.
/// Source: [Reinhard02, Eq. 1–2]; differs: trimmed.
pub fn compute_auto_exposure_ev(raster: &Raster) -> f32 {
    let mut luminances: Vec<f32> = raster
        .data
        .chunks_exact(raster.channels.max(1))
        .map(|pixel| luminance([0, 1, 2].map(|c| pixel[c % pixel.len()])))
        .filter(|value| value.is_normal() && *value > 0.0)
        .collect();
    if luminances.is_empty() {
        return 0.0;
    }
    luminances.sort_unstable_by(f32::total_cmp);
    let cut = (luminances.len() as f64 * TRIM) as usize;
    let middle = &luminances[cut..luminances.len() - cut];
    let sum: f64 = middle.iter().map(|&value| f64::from(value).log2()).sum();
    (MIDDLE_GREY.log2() - sum / middle.len() as f64).clamp(-MAX_EV, MAX_EV) as f32
}

impl ToneCurve {
    /// The sRGB code values in 0..1 of exposed light.
    fn eval(self, rgb: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Agx => eval_agx(rgb),
            Self::Aces => rgb.map(|x| {
                // Narkowicz's fit, with the exposure factor he gives for the ACES reference.
                let x = 0.6 * x;
                srgb_from_linear((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14))
            }),
            Self::Linear => rgb.map(srgb_from_linear),
        }
    }
}

/// Rows: AgX's inset from linear Rec.709.
const AGX_FROM_REC709: [[f32; 3]; 3] = [
    [0.842_479_06, 0.078_433_6, 0.079_223_745],
    [0.042_328_242, 0.878_468_64, 0.079_166_13],
    [0.042_375_655, 0.078_433_6, 0.879_143],
];
/// Rows: the way back, on code values.
const REC709_FROM_AGX: [[f32; 3]; 3] = [
    [1.196_879, -0.098_020_88, -0.099_029_74],
    [-0.052_896_852, 1.151_903_1, -0.098_961_18],
    [-0.052_971_636, -0.098_043_45, 1.151_073_7],
];
/// Exposure range of the curve, log2 of light.
const AGX_MIN_EV: f32 = -12.473_93;
const AGX_MAX_EV: f32 = 4.026_069;

/// AgX with its default contrast and no look.
fn eval_agx(rgb: [f32; 3]) -> [f32; 3] {
    let curved = multiply(&AGX_FROM_REC709, rgb).map(|light| {
        let ev = light.max(1e-10).log2().clamp(AGX_MIN_EV, AGX_MAX_EV);
        eval_agx_contrast((ev - AGX_MIN_EV) / (AGX_MAX_EV - AGX_MIN_EV))
    });
    multiply(&REC709_FROM_AGX, curved).map(|code| code.clamp(0.0, 1.0))
}

/// Wrensch's sixth-order fit of the contrast curve on 0..1.
fn eval_agx_contrast(x: f32) -> f32 {
    const COEFFICIENTS: [f32; 7] = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232];
    COEFFICIENTS.iter().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

/// A matrix of rows times a column.
fn multiply(rows: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    const CURVES: [ToneCurve; 3] = [ToneCurve::Agx, ToneCurve::Aces, ToneCurve::Linear];

    #[test]
    fn curves_are_monotone_and_bounded_on_grey() {
        for curve in CURVES {
            let mut last = [0.0; 3];
            for step in -200..=160 {
                let code = curve.eval([(step as f32 / 10.0).exp2().min(BRIGHTEST); 3]);
                for (code, last) in code.iter().zip(last) {
                    assert!((0.0..=1.0).contains(code), "{curve:?} {step}");
                    assert!(*code >= last - 1e-5, "{curve:?} {step}: {code} < {last}");
                }
                last = code;
            }
            assert!(last[0] > 0.97, "{curve:?} reaches white: {last:?}");
            assert!((curve.eval([0.18; 3])[0] - 0.46).abs() < 0.1, "{curve:?} keeps middle grey");
        }
    }

    #[test]
    fn odd_values_have_defined_bytes() {
        let data = vec![f32::NAN, -1.0, f32::NEG_INFINITY, f32::INFINITY, f32::MAX, 1e30];
        let raster = Raster { width: 2, height: 1, channels: 3, data };
        for curve in CURVES {
            for exposure_ev in [Some(0.0), None, Some(f32::NAN), Some(200.0), Some(-200.0)] {
                let bytes = tone_map(&raster, &ToneSettings { exposure_ev, curve }).unwrap();
                assert_eq!(bytes[..3], [0; 3]);
            }
            let settings = ToneSettings { exposure_ev: Some(0.0), curve };
            assert!(tone_map(&raster, &settings).unwrap()[3..].iter().all(|&byte| byte > 247));
        }
        let inconsistent = Raster { width: 2, height: 2, channels: 3, data: vec![0.0; 3] };
        assert!(tone_map(&inconsistent, &ToneSettings::default()).is_err());
    }

    #[test]
    fn automatic_exposure_ignores_sky_and_black() {
        let mut raster = Raster::new(100, 1, 1);
        raster.data.fill(0.36);
        raster.data[..30].fill(0.0);
        raster.data[30..36].fill(1e6);
        raster.data[36] = f32::NAN;
        assert!((compute_auto_exposure_ev(&raster) + 1.0).abs() < 1e-5);
        assert_eq!(compute_auto_exposure_ev(&Raster::new(3, 3, 3)), 0.0);
        raster.data.fill(f32::INFINITY);
        assert_eq!(compute_auto_exposure_ev(&raster), 0.0);
    }

    #[test]
    fn linear_curve_is_srgb() {
        let raster = Raster { width: 1, height: 1, channels: 1, data: vec![0.214_041_14] };
        let settings = ToneSettings { exposure_ev: Some(0.0), curve: ToneCurve::Linear };
        assert_eq!(tone_map(&raster, &settings).unwrap(), [128; 3]);
    }
}

//! Luminance and the sRGB curve.

/// The weights of linear Rec.709 red, green and blue in luminance.
///
/// Source: ITU-R BT.709-6, item 3.2.
pub const LUMINANCE_WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// The luminance of a linear Rec.709 colour.
pub fn luminance(rgb: [f32; 3]) -> f32 {
    let [r, g, b] = LUMINANCE_WEIGHTS;
    r * rgb[0] + g * rgb[1] + b * rgb[2]
}

/// The sRGB code value in 0..1 of a linear value; values outside 0..1 are clamped, NaN gives 0.
///
/// Source: IEC 61966-2-1.
pub fn srgb_from_linear(linear: f32) -> f32 {
    let linear = bound(linear, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear value of an sRGB code value in 0..1; values outside are clamped, NaN gives 0.
///
/// Source: IEC 61966-2-1.
pub fn linear_from_srgb(srgb: f32) -> f32 {
    let srgb = bound(srgb, 1.0);
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// A value in 0..hi; NaN becomes 0, which `clamp` would let pass.
pub(crate) fn bound(value: f32, hi: f32) -> f32 {
    if value > 0.0 { value.min(hi) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_curve_inverts_and_is_bounded() {
        for code in 0..=1000 {
            let srgb = code as f32 / 1000.0;
            assert!((srgb_from_linear(linear_from_srgb(srgb)) - srgb).abs() < 1e-5);
        }
        for odd in [f32::NAN, f32::NEG_INFINITY, -1.0] {
            assert_eq!(srgb_from_linear(odd), 0.0);
            assert_eq!(linear_from_srgb(odd), 0.0);
        }
        assert!((srgb_from_linear(f32::INFINITY) - 1.0).abs() < 1e-6);
        assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-6);
    }
}

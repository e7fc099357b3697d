//! The colour spaces of FLIP, and the tone curve of HDR-FLIP.
//!
//! In: linear Rec.709. Out: YCxCz, CIELAB after Hunt.
//! Papers: [Andersson20, Sec. 4.1], `[Andersson21]`.
//! Limits: reference white is that of Rec.709.

/// Three channels of one pixel.
pub(super) type Rgb = [f32; 3];

/// Rows: CIE XYZ from linear Rec.709.
///
/// Source: IEC 61966-2-1 primaries and white, solved exactly.
const XYZ_FROM_LINEAR: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// The matrix from linear Rec.709 to XYZ divided by the white point's XYZ.
const RELATIVE_XYZ: [[f32; 3]; 3] = relative_xyz();
/// Its inverse.
const LINEAR: [[f32; 3]; 3] = inverse(relative_xyz_f64());

/// YCxCz, the linear opponent space in which FLIP filters.
pub(super) fn ycxcz_from_linear(linear: Rgb) -> Rgb {
    let [x, y, z] = multiply(&RELATIVE_XYZ, linear);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// The way back from YCxCz.
pub(super) fn linear_from_ycxcz(ycxcz: Rgb) -> Rgb {
    let y = (ycxcz[0] + 16.0) / 116.0;
    multiply(&LINEAR, [y + ycxcz[1] / 500.0, y, y - ycxcz[2] / 200.0])
}

/// CIELAB with chroma scaled by lightness, as Hunt observed.
pub(super) fn hunt_lab_from_linear(linear: Rgb) -> Rgb {
    const DELTA: f32 = 6.0 / 29.0;
    let [x, y, z] = multiply(&RELATIVE_XYZ, linear).map(|t| {
        if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// HyAB: city-block in lightness, Euclidean in chroma.
pub(super) fn hyab(a: Rgb, b: Rgb) -> f32 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Narkowicz's ACES fit with the 0.6 exposure folded in: numerator, then denominator, from
/// the square down `[Andersson21]`.
const ACES: [f64; 6] = [0.36 * 2.51, 0.6 * 0.03, 0.0, 0.36 * 2.43, 0.6 * 0.59, 0.14];

/// The tone curve of HDR-FLIP, in 0..1.
pub(super) fn tone_map_aces(light: f32) -> f32 {
    const K: [f32; 6] = {
        let a = ACES;
        [a[0] as f32, a[1] as f32, a[2] as f32, a[3] as f32, a[4] as f32, a[5] as f32]
    };
    // Beyond this the curve has saturated, and squares stay finite.
    let x = light.min(1e6);
    let value = ((K[0] * x + K[1]) * x + K[2]) / ((K[3] * x + K[4]) * x + K[5]);
    value.clamp(0.0, 1.0)
}

/// The coefficients a, b, c of a·x² + b·x + c = 0, where the curve reaches `level`.
pub(super) fn aces_quadratic(level: f64) -> (f64, f64, f64) {
    (ACES[0] - level * ACES[3], ACES[1] - level * ACES[4], ACES[2] - level * ACES[5])
}

/// A matrix of rows times a column.
fn multiply(rows: &[[f32; 3]; 3], v: Rgb) -> Rgb {
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Each row divided by its sum: white becomes (1, 1, 1).
const fn relative_xyz_f64() -> [[f64; 3]; 3] {
    let mut m = XYZ_FROM_LINEAR;
    let mut row = 0;
    while row < 3 {
        let sum = m[row][0] + m[row][1] + m[row][2];
        m[row] = [m[row][0] / sum, m[row][1] / sum, m[row][2] / sum];
        row += 1;
    }
    m
}

/// The same in single precision.
const fn relative_xyz() -> [[f32; 3]; 3] {
    round(relative_xyz_f64())
}

/// The inverse of a matrix by cofactors.
const fn inverse(m: [[f64; 3]; 3]) -> [[f32; 3]; 3] {
    let mut out = [[0.0; 3]; 3];
    let mut i = 0;
    while i < 3 {
        let mut j = 0;
        while j < 3 {
            // Cyclic indices give the cofactor its sign.
            let (r1, r2) = ((j + 1) % 3, (j + 2) % 3);
            let (c1, c2) = ((i + 1) % 3, (i + 2) % 3);
            out[i][j] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
            j += 1;
        }
        i += 1;
    }
    let determinant = m[0][0] * out[0][0] + m[0][1] * out[1][0] + m[0][2] * out[2][0];
    let mut i = 0;
    while i < 9 {
        out[i / 3][i % 3] /= determinant;
        i += 1;
    }
    round(out)
}

/// Double to single precision.
const fn round(m: [[f64; 3]; 3]) -> [[f32; 3]; 3] {
    let mut out = [[0.0; 3]; 3];
    let mut i = 0;
    while i < 9 {
        out[i / 3][i % 3] = m[i / 3][i % 3] as f32;
        i += 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opponent_space_inverts_and_white_is_neutral() {
        let rgb = [0.2, 0.9, 0.4];
        for (back, value) in linear_from_ycxcz(ycxcz_from_linear(rgb)).iter().zip(rgb) {
            assert!((back - value).abs() < 1e-5);
        }
        let [lightness, a, b] = hunt_lab_from_linear([1.0; 3]);
        assert!((lightness - 100.0).abs() < 1e-3 && a.abs() < 1e-2 && b.abs() < 1e-2);
        assert!(hunt_lab_from_linear([0.0; 3])[0].abs() < 1e-4);
    }
}

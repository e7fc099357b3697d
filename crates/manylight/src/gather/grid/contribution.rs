//! What one grid light gives one receiver: a point light's geometry term with the spread of the
//! lights it stands for.
//!
//! A plain point at the mean position errs by the second derivative of the geometry term times the
//! variance: too bright from a patch that it faces, too dark along one, and blind to what the
//! horizon cuts. To second order in spread over distance, and bounded beyond:
//!
//! - 1/d⁴ pulls the cosines' mean position towards the receiver: offset ∘ d²/(d² + 4v);
//! - its own mean is 1/far⁴ + 12 Σ vᵢ·offsetᵢ² / far⁸ with far² = d² + FAR Σ vᵢ, which to second
//!   order is 1/d⁴ · (1 + Σ vᵢ (12 wᵢ² − 2) / d²) for FAR = 1;
//! - each clamped cosine is the mean of the clamp over a uniform spread;
//! - the mean of the two cosines' product is that of their means and their covariance −Σ nᵢ·mᵢ·vᵢ.

use super::tiles::TileLight;
use glam::Vec3;

/// Share of the variance that adds to the squared distance; 1 is second order at large distances,
/// less makes up for the orders left out near by (`docs/decisions/0002-spread-of-grid-lights.md`).
pub(super) const FAR: f32 = 0.65;
/// Squared distance below which a light counts as this far, in variances and in m²: only keeps the
/// arithmetic finite.
pub(super) const NEAREST_SQ: [f32; 2] = [1e-2, 1e-20];
/// Least width of a soft clamp, m: keeps the fraction finite where there is no spread.
pub(super) const NO_SPREAD: f32 = 1e-10;

/// (p + q)² ≤ 2.74 p² + 1.58 q², and q² is three times as much.
pub(super) const REACH_PULL: f32 = 2.74;
pub(super) const REACH_SPREAD: f32 = 3.0 * 1.58;

/// Squared distance from which on [`geometry`] is right.
pub(super) fn nearest_sq(total_variance: f32) -> f32 {
    NEAREST_SQ[0] * total_variance + NEAREST_SQ[1]
}

/// What the spread adds to the squared distance in 1/d⁴.
pub(super) fn far(total_variance: f32) -> f32 {
    FAR * total_variance
}

/// Variance across a direction of normals with a mean.
pub(super) fn normal_spread(mean: Vec3) -> f32 {
    (1.0 - mean.length_squared()).max(0.0) * 0.5
}

/// Bounds how far behind its mean plane a light shines: at squared distance d² nothing lies beyond
/// depth² = a + b·d². In units of the distance, the soft clamp ends √(3 (s + t)) behind the plane,
/// for s = Σ mᵢ² vᵢ and the spread t of the normals, and the pull towards the receiver moves the
/// plane by Σ |mᵢ wᵢ| · 4vᵢ/(1 + 4vᵢ) ≤ √s; (p + q)² ≤ 2.74 p² + 1.58 q².
pub(super) fn reach_behind(normal: Vec3, normal_spread: f32, variance: Vec3) -> [f32; 2] {
    let s = (normal * normal * variance).element_sum();
    [(REACH_PULL + REACH_SPREAD) * s, REACH_SPREAD * normal_spread]
}

/// Bounds how far below a receiver's horizon the mean of a light that it sees lies, squared: as
/// [`reach_behind`], for any normal of the receiver.
pub(super) fn reach_below(variance: Vec3) -> f32 {
    (REACH_PULL + REACH_SPREAD) * variance.max_element()
}

/// Mean of cosθ_x · cosθ_l / d² over the lights of a grid light, m⁻², before blending.
///
/// `FUSED` rounds products and sums once, for processors that do so in one step.
/// `offset` is the light's mean position − receiver, `n` the receiver's unit normal.
#[inline(always)]
pub(super) fn geometry<const FUSED: bool>(
    light: &TileLight,
    offset: [f32; 3],
    n: [f32; 3],
    d_min_sq: f32,
) -> f32 {
    let [x, y, z] = offset;
    let m = light.normal;
    let v4 = light.variance_4;
    let dist_sq = dot::<FUSED>(offset, offset);
    let dist_sq = if dist_sq > light.nearest_sq { dist_sq } else { light.nearest_sq };

    let inverse_sq = 1.0 / dist_sq;

    // r = 1/(1 + 4v/d²) per axis, with one division.
    let a = v4.map(|v| mul_add::<FUSED>(v, inverse_sq, 1.0));
    let a_yz = a[1] * a[2];
    let product = 1.0 / (a[0] * a_yz);
    let x_product = a[0] * product;
    let r = [a_yz * product, a[2] * x_product, a[1] * x_product];

    let p = [x * r[0], y * r[1], z * r[2]];
    let s4 = [v4[0] * r[0], v4[1] * r[1], v4[2] * r[2]];
    let ns4 = [n[0] * s4[0], n[1] * s4[1], n[2] * s4[2]];
    let ms4 = [m[0] * s4[0], m[1] * s4[1], m[2] * s4[2]];
    let spread_x = 0.75 * dot::<FUSED>(n, ns4);
    let spread_l = mul_add::<FUSED>(light.normal_spread_3, dist_sq, 0.75 * dot::<FUSED>(m, ms4));
    let cos_x = SoftClamp::new::<FUSED>(dot::<FUSED>(n, p), spread_x);
    let cos_l = SoftClamp::new::<FUSED>(-dot::<FUSED>(m, p), spread_l);
    let joint = 0.25 * dot::<FUSED>(n, ms4);
    let cosines = mul_add::<FUSED>(cos_x.above, cos_l.above, -joint * (cos_x.open * cos_l.open));
    let cosines = if cosines > 0.0 { cosines } else { 0.0 };

    let far = mul_add::<FUSED>(light.far, inverse_sq, 1.0);
    let far_sq = far * far;
    let along = 3.0 * dot::<FUSED>([v4[0] * x, v4[1] * y, v4[2] * z], offset) * inverse_sq;
    let mean = mul_add::<FUSED>(along, inverse_sq, far_sq);
    let clamp = d_min_sq * inverse_sq;
    let clamped = if far > clamp { far } else { clamp };
    let below = cos_x.below * cos_l.below * far_sq * (far * clamped);
    (cosines * inverse_sq) * (mean * inverse_sq) / below
}

/// a·b + c, rounded once where `FUSED`.
#[inline(always)]
pub(super) fn mul_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

#[inline(always)]
pub(super) fn dot<const FUSED: bool>(a: [f32; 3], b: [f32; 3]) -> f32 {
    mul_add::<FUSED>(a[0], b[0], mul_add::<FUSED>(a[1], b[1], a[2] * b[2]))
}

/// Mean of max(0, a + t) for t uniform with a variance, as a fraction.
struct SoftClamp {
    above: f32,
    below: f32,
    /// Share of t for which a + t > 0, over `below`.
    open: f32,
}

impl SoftClamp {
    /// `variance_3` is three times the variance: the square of half the width.
    #[inline(always)]
    fn new<const FUSED: bool>(a: f32, variance_3: f32) -> Self {
        let half_width = variance_3.sqrt();
        let width = half_width + half_width;
        let below = width + width;
        let below = if below > NO_SPREAD { below } else { NO_SPREAD };
        let t = a + half_width;
        let t = if t > 0.0 { t } else { 0.0 };
        let t = if t < width { t } else { width };
        let rest = a - half_width;
        let rest = if rest > 0.0 { rest } else { 0.0 };
        Self { above: mul_add::<FUSED>(t, t, below * rest), below, open: t + t }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Sequence, uniform_sphere};

    fn soft_clamp(a: f32, variance: f32) -> f32 {
        let SoftClamp { above, below, .. } = SoftClamp::new::<false>(a, 3.0 * variance);
        above / below
    }

    #[test]
    fn the_soft_clamp_is_the_mean_of_the_clamp() {
        for (a, variance) in [(-2.0f32, 0.1f32), (-0.3, 0.1), (0.0, 0.1), (0.2, 0.1), (3.0, 0.1)] {
            let half = (3.0 * variance).sqrt();
            let at = |i: u32| (a + half * (2.0 * (i as f32 + 0.5) / 10_000.0 - 1.0)).max(0.0);
            let mean = (0..10_000).map(at).sum::<f32>() / 10_000.0;
            assert!((soft_clamp(a, variance) - mean).abs() < 1e-4, "{a}");
        }
        assert!((soft_clamp(0.7, 0.0) - 0.7).abs() < 1e-5 && soft_clamp(-0.7, 0.0) == 0.0);
    }

    #[test]
    fn nothing_shines_beyond_its_reach() {
        let mut beyond = 0;
        for i in 0..20_000 {
            let mut s = Sequence::new(9, i);
            let normal = uniform_sphere(s.next_2d()) * s.next_1d().sqrt();
            let variance = Vec3::new(s.next_1d(), s.next_1d(), s.next_1d()).powf(4.0) * 0.1;
            let light = spread_light(normal, variance);
            let offset = uniform_sphere(s.next_2d()) * (0.01 + s.next_1d());
            let n = uniform_sphere(s.next_2d());
            let [constant, slope] = reach_behind(normal, normal_spread(normal), variance);
            let (behind, below) = (normal.dot(offset), -n.dot(offset));
            let is_behind = behind * behind >= constant + slope * offset.length_squared();
            let is_below = below * below >= reach_below(variance);
            if (behind > 0.0 && is_behind) || (below > 0.0 && is_below) {
                beyond += 1;
                assert!(geometry::<false>(&light, offset.to_array(), n.to_array(), 0.01) == 0.0);
            }
        }
        assert!(beyond > 1000);
    }

    #[test]
    fn no_spread_is_a_point_light() {
        let light = TileLight { normal: [0.0, 1.0, 0.0], ..TileLight::default() };
        for i in 0..200 {
            let mut s = Sequence::new(3, i);
            let offset = uniform_sphere(s.next_2d()) * (0.01 + 5.0 * s.next_1d());
            let n = uniform_sphere(s.next_2d());
            let expected = crate::vlight::vpl::geometry(offset, Vec3::Y, Vec3::ZERO, n, 0.01);
            let got = geometry::<false>(&light, offset.to_array(), n.to_array(), 0.01);
            assert!((got - expected).abs() <= 1e-4 * expected + 1e-5, "{got} for {expected}");
        }
    }

    #[test]
    fn fused_and_plain_agree() {
        for i in 0..2000 {
            let mut s = Sequence::new(13, i);
            let normal = uniform_sphere(s.next_2d()) * s.next_1d().sqrt();
            let light = spread_light(normal, Vec3::new(s.next_1d(), s.next_1d(), 0.1) * 0.2);
            let (offset, n) = (uniform_sphere(s.next_2d()).to_array(), uniform_sphere(s.next_2d()));
            let plain = geometry::<false>(&light, offset, n.to_array(), 0.01);
            let fused = geometry::<true>(&light, offset, n.to_array(), 0.01);
            assert!((plain - fused).abs() <= 1e-4 * plain + 1e-5, "{plain} {fused}");
        }
    }

    /// The unit of length does not matter: g ∝ 1/m².
    #[test]
    fn scenes_may_be_tiny_or_huge() {
        for i in 0..500 {
            let mut s = Sequence::new(29, i);
            let normal = uniform_sphere(s.next_2d()) * s.next_1d().sqrt();
            let variance = Vec3::new(s.next_1d(), s.next_1d(), s.next_1d()).powf(4.0);
            let (offset, n) = (uniform_sphere(s.next_2d()), uniform_sphere(s.next_2d()));
            let at = |unit: f32, variance: Vec3| {
                let light = spread_light(normal, variance * unit * unit);
                let offset = (offset * unit).to_array();
                geometry::<false>(&light, offset, n.to_array(), 1e-4 * unit * unit) * unit * unit
            };
            for variance in [variance, Vec3::ZERO] {
                let expected = at(1.0, variance);
                for unit in [1e-7, 1e-3, 1e4, 1e8] {
                    let g = at(unit, variance);
                    assert!((g - expected).abs() <= 2e-3 * expected + 1e-4, "{unit}: {g}");
                }
            }
        }
    }

    /// Where a light's spread runs along both normals, its cosines rise and fall together.
    #[test]
    fn cosines_that_vary_together_count() {
        let light = spread_light(Vec3::NEG_Y, Vec3::new(0.0, 0.04, 0.0));
        let n = Vec3::Y;
        // Lights at 0.8 and 1.2 in front of a receiver that faces them: mean of d²/d⁴.
        let truth = 0.5 * (1.0 / (0.8f32 * 0.8) + 1.0 / (1.2 * 1.2));
        let got = geometry::<false>(&light, [0.0, 1.0, 0.0], n.to_array(), 1e-6);
        assert!((got / truth - 1.0).abs() < 0.06, "{got} for {truth}");
    }

    fn spread_light(normal: Vec3, variance: Vec3) -> TileLight {
        let total = variance.element_sum();
        TileLight {
            normal: normal.to_array(),
            variance_4: (4.0 * variance).to_array(),
            nearest_sq: nearest_sq(total),
            far: far(total),
            normal_spread_3: 3.0 * normal_spread(normal),
            ..TileLight::default()
        }
    }

    /// A square patch seen from all around: the spread removes most of a point's error.
    #[test]
    fn a_patch_is_closer_than_its_mean_point() {
        const SIDE: usize = 64;
        let at = |i: usize| (i as f32 + 0.5) / SIDE as f32 - 0.5;
        let patch = |i: usize| Vec3::new(at(i % SIDE), 0.0, at(i / SIDE));
        let variance = (0..SIDE).map(|i| at(i) * at(i)).sum::<f32>() / SIDE as f32;
        let point = TileLight { normal: [0.0, 1.0, 0.0], ..TileLight::default() };
        let spread = TileLight {
            variance_4: [4.0 * variance, 0.0, 4.0 * variance],
            far: far(2.0 * variance),
            ..point
        };
        let (mut error, mut point_error, mut sum) = (0.0, 0.0, 0.0);
        for i in 0..400 {
            let mut s = Sequence::new(5, i);
            let mut receiver = uniform_sphere(s.next_2d()) * (0.7 + s.next_1d());
            receiver.y = receiver.y.abs();
            let n = uniform_sphere(s.next_2d());
            let term = |k| crate::vlight::vpl::geometry(patch(k), Vec3::Y, receiver, n, 1e-6);
            let truth = (0..SIDE * SIDE).map(term).sum::<f32>() / (SIDE * SIDE) as f32;
            let of = |l| geometry::<false>(l, (-receiver).to_array(), n.to_array(), 1e-6);
            error += (of(&spread) - truth).powi(2);
            point_error += (of(&point) - truth).powi(2);
            sum += truth;
        }
        assert!(sum > 0.0 && error < 0.33 * point_error, "{error} against {point_error}");
    }
}

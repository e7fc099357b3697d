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
const FAR: f32 = 0.65;
/// Squared distances below and above which a light counts as this far, in variances and in m²: only
/// keep the arithmetic finite.
const NEAREST_SQ: [f32; 2] = [1e-2, 1e-12];
const FARTHEST_SQ: f32 = 1e12;
/// Least width of a soft clamp, m: keeps the fraction finite where there is no spread.
const NO_SPREAD: f32 = 1e-10;

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
pub(super) fn reach_behind(normal: Vec3, variance: Vec3) -> [f32; 2] {
    let s = (normal * normal * variance).element_sum();
    [(2.74 + 3.0 * 1.58) * s, 3.0 * 1.58 * normal_spread(normal)]
}

/// Bounds how far below a receiver's horizon the mean of a light that it sees lies, squared: as
/// [`reach_behind`], for any normal of the receiver.
pub(super) fn reach_below(variance: Vec3) -> f32 {
    (2.74 + 3.0 * 1.58) * variance.max_element()
}

/// Mean of cosθ_x · cosθ_l / d² over the lights of a grid light, m⁻², before blending.
///
/// `offset` is the light's mean position − receiver, `n` the receiver's unit normal.
#[inline(always)]
pub(super) fn geometry(light: &TileLight, offset: [f32; 3], n: [f32; 3], d_min_sq: f32) -> f32 {
    let [x, y, z] = offset;
    let [mx, my, mz] = light.normal;
    let [vx, vy, vz] = light.variance;
    let dist_sq = x * x + y * y + z * z;
    let dist_sq = if dist_sq > light.nearest_sq { dist_sq } else { light.nearest_sq };
    let dist_sq = if dist_sq < FARTHEST_SQ { dist_sq } else { FARTHEST_SQ };

    // r = d²/(d² + 4v) per axis, with one division.
    let [ax, ay, az] = [dist_sq + 4.0 * vx, dist_sq + 4.0 * vy, dist_sq + 4.0 * vz];
    let scale = dist_sq / (ax * ay * az);
    let [rx, ry, rz] = [ay * az * scale, az * ax * scale, ax * ay * scale];
    // About 1/d²: with it the squares of lengths below stay small numbers without a unit.
    let unit = dist_sq * scale;

    let [px, py, pz] = [x * rx, y * ry, z * rz];
    let [sx, sy, sz] = [vx * rx, vy * ry, vz * rz];
    let spread_x = n[0] * n[0] * sx + n[1] * n[1] * sy + n[2] * n[2] * sz;
    let spread_l = mx * mx * sx + my * my * sy + mz * mz * sz + light.normal_spread * dist_sq;
    let joint = n[0] * mx * sx + n[1] * my * sy + n[2] * mz * sz;
    let cos_x = SoftClamp::new(n[0] * px + n[1] * py + n[2] * pz, spread_x);
    let cos_l = SoftClamp::new(-(mx * px + my * py + mz * pz), spread_l);
    let cosines = cos_x.above * cos_l.above - joint * cos_x.open * cos_l.open;
    let cosines = if cosines > 0.0 { cosines } else { 0.0 };

    let far = (dist_sq + light.far) * unit;
    let along = 12.0 * (vx * x * x + vy * y * y + vz * z * z) * unit * unit;
    let clamp = d_min_sq * unit;
    let clamped = if far > clamp { far } else { clamp };
    let below = cos_x.below * cos_l.below * (far * far) * (far * clamped);
    (cosines * unit) * (far * far + along) * unit / below
}

/// Mean of max(0, a + t) for t uniform with a variance, as a fraction.
struct SoftClamp {
    above: f32,
    below: f32,
    /// Share of t for which a + t > 0, over `below`.
    open: f32,
}

impl SoftClamp {
    #[inline(always)]
    fn new(a: f32, variance: f32) -> Self {
        let half_width = (3.0 * variance).sqrt();
        let below = 4.0 * half_width;
        let below = if below > NO_SPREAD { below } else { NO_SPREAD };
        let t = a + half_width;
        let t = if t > 0.0 { t } else { 0.0 };
        let t = if t < 2.0 * half_width { t } else { 2.0 * half_width };
        let rest = a - half_width;
        let rest = if rest > 0.0 { rest } else { 0.0 };
        Self { above: t * t + below * rest, below, open: 2.0 * t }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Sequence, uniform_sphere};

    fn soft_clamp(a: f32, variance: f32) -> f32 {
        let SoftClamp { above, below, .. } = SoftClamp::new(a, variance);
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
            let light = TileLight {
                normal: normal.to_array(),
                variance: variance.to_array(),
                nearest_sq: nearest_sq(variance.element_sum()),
                far: far(variance.element_sum()),
                normal_spread: normal_spread(normal),
                ..TileLight::default()
            };
            let offset = uniform_sphere(s.next_2d()) * (0.01 + s.next_1d());
            let n = uniform_sphere(s.next_2d());
            let [constant, slope] = reach_behind(normal, variance);
            let (behind, below) = (normal.dot(offset), -n.dot(offset));
            let is_behind = behind * behind >= constant + slope * offset.length_squared();
            let is_below = below * below >= reach_below(variance);
            if (behind > 0.0 && is_behind) || (below > 0.0 && is_below) {
                beyond += 1;
                assert!(geometry(&light, offset.to_array(), n.to_array(), 0.01) == 0.0);
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
            let got = geometry(&light, offset.to_array(), n.to_array(), 0.01);
            assert!((got - expected).abs() <= 1e-4 * expected + 1e-5, "{got} for {expected}");
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
        let spread =
            TileLight { variance: [variance, 0.0, variance], far: far(2.0 * variance), ..point };
        let (mut error, mut point_error, mut sum) = (0.0, 0.0, 0.0);
        for i in 0..400 {
            let mut s = Sequence::new(5, i);
            let mut receiver = uniform_sphere(s.next_2d()) * (0.7 + s.next_1d());
            receiver.y = receiver.y.abs();
            let n = uniform_sphere(s.next_2d());
            let term = |k| crate::vlight::vpl::geometry(patch(k), Vec3::Y, receiver, n, 1e-6);
            let truth = (0..SIDE * SIDE).map(term).sum::<f32>() / (SIDE * SIDE) as f32;
            let of = |l| geometry(l, (-receiver).to_array(), n.to_array(), 1e-6);
            error += (of(&spread) - truth).powi(2);
            point_error += (of(&point) - truth).powi(2);
            sum += truth;
        }
        assert!(sum > 0.0 && error < 0.33 * point_error, "{error} against {point_error}");
    }
}

//! Light that arrives straight from its source.
//!
//! In: receivers, emitters · Out: direct irradiance per receiver
//! Sun, point and spot lights are exact, one shadow ray each (a few drawn by weight when there
//! are many); the sky is lights at infinity; emissive surfaces go through a gather.

#[cfg(feature = "gpu")]
pub mod gpu;

use crate::emitter::{DirectSample, Emitters, SkyEmitter};
use crate::math::{Sequence, cosine_hemisphere, luminance};
use crate::shadow;
use crate::surface::SurfacePoint;
use crate::world::World;
use glam::Vec3;
use std::f32::consts::PI;

/// Up to this many lights are all evaluated; of more, this many are drawn.
pub const EXACT_LIGHTS: usize = 4;
/// Candidates per sky ray under a map, resampled by the cosine.
const SKY_CANDIDATES: u32 = 8;

/// Irradiance from sun, point and spot lights at one receiver, with visibility, W·m⁻².
pub fn from_lights(
    world: &World,
    emitters: &Emitters,
    surface: &SurfacePoint,
    sequence: &mut Sequence,
) -> Vec3 {
    let unshadowed = |index: usize| {
        let sample = emitters.direct(index, surface.position)?;
        let e = sample.irradiance * surface.ns.dot(sample.direction).max(0.0);
        (e.max_element() > 0.0).then_some((sample, e))
    };
    let seen =
        |sample: &DirectSample| shadow::is_open(world, surface, sample.direction, sample.distance);
    let count = emitters.lights.len();
    if count <= EXACT_LIGHTS {
        return (0..count)
            .filter_map(unshadowed)
            .map(|(sample, e)| if seen(&sample) { e } else { Vec3::ZERO })
            .sum();
    }
    // Independent draws in proportion to the unshadowed luminance.
    let candidates: Vec<_> = (0..count).filter_map(unshadowed).collect();
    let total: f32 = candidates.iter().map(|c| luminance(c.1)).sum();
    let draw = |u: f32| {
        let mut left = u * total;
        let found = candidates.iter().find(|c| {
            left -= luminance(c.1);
            left < 0.0
        });
        found.or(candidates.last()).map_or(Vec3::ZERO, |(sample, e)| {
            let weight = total / luminance(*e) / EXACT_LIGHTS as f32;
            if seen(sample) { *e * weight } else { Vec3::ZERO }
        })
    };
    (0..EXACT_LIGHTS).map(|_| draw(sequence.next_1d())).sum()
}

/// Irradiance from the sky at one receiver without visibility, W·m⁻², and the share of it that
/// arrives, by `rays` shadow rays.
///
/// A constant sky draws directions by their cosine; a map draws them by its light and resamples
/// by the cosine.
pub fn from_sky(
    world: &World,
    sky: &SkyEmitter,
    surface: &SurfacePoint,
    sequences: impl Iterator<Item = Sequence>,
    is_constant: bool,
) -> [Vec3; 2] {
    let (mut unshadowed, mut seen, mut rays) = (Vec3::ZERO, Vec3::ZERO, 0);
    for mut sequence in sequences {
        rays += 1;
        let (direction, irradiance) = if is_constant {
            let direction = cosine_hemisphere(surface.ns, sequence.next_2d());
            (direction, sky.radiance(direction) * PI)
        } else {
            resample_sky(sky, surface.ns, &mut sequence)
        };
        unshadowed += irradiance;
        if irradiance.max_element() > 0.0
            && shadow::is_open(world, surface, direction, f32::INFINITY)
        {
            seen += irradiance;
        }
    }
    [unshadowed, seen].map(|sum| sum / rays.max(1) as f32)
}

/// One direction drawn in proportion to radiance · cosine, and its irradiance over its density.
fn resample_sky(sky: &SkyEmitter, ns: Vec3, sequence: &mut Sequence) -> (Vec3, Vec3) {
    let (mut total, mut held) = (0.0, (Vec3::Y, Vec3::ZERO, 1.0));
    for _ in 0..SKY_CANDIDATES {
        let (direction, radiance, pdf_sa) = sky.sample(sequence.next_2d());
        let e = radiance * (ns.dot(direction).max(0.0) / pdf_sa);
        let weight = luminance(e);
        total += weight;
        if weight > 0.0 && sequence.next_1d() * total < weight {
            held = (direction, e, weight);
        }
    }
    (held.0, held.1 * (total / SKY_CANDIDATES as f32 / held.2))
}

//! Random walks from the sources, leaving a virtual light at every hit.

use super::{Vpl, VplSet};
use crate::bvh::Ray;
use crate::emitter::Emitters;
use crate::math::{Sequence, cosine_hemisphere};
use crate::world::World;
use glam::Vec3;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Paths traced between two looks at the count.
pub(super) const BATCH: u32 = 1 << 14;
/// Gives up on a scene whose light paths leave fewer lights than one per this many paths.
pub(super) const PATHS_PER_LIGHT: u64 = 256;
/// Largest correction of a shading normal against the geometric one at a light path's vertex.
pub(super) const MAX_NORMAL_CORRECTION: f32 = 8.0;

/// Traces light paths until about `count` lights exist, at most `bounces` to a path.
///
/// Path j draws from (seed, j, dimension) alone. The set ends with a whole path.
///
/// Units: intensity W·sr⁻¹, divided by the number of paths
/// Cost:  about 1.2 rays per light
pub fn trace(
    world: &World,
    emitters: &Emitters,
    count: u32,
    bounces: u32,
    seed: u32,
    normal_maps: bool,
) -> VplSet {
    let mut set = VplSet::default();
    let count = count as usize;
    let limit = (count as u64 * PATHS_PER_LIGHT).min(u64::from(u32::MAX - BATCH));
    while set.lights.len() < count && set.path_count < limit && !emitters.is_dark() {
        let first = set.path_count as u32;
        let paths: Vec<Vec<Vpl>> = (first..first + BATCH)
            .into_par_iter()
            .with_min_len(256)
            .map(|j| trace_path(world, emitters, Sequence::new(seed, j), bounces, normal_maps))
            .collect();
        for path in paths {
            if set.lights.len() >= count {
                break;
            }
            set.lights.extend(path);
            set.path_count += 1;
        }
    }
    let scale = 1.0 / set.path_count.max(1) as f32;
    set.lights.iter_mut().for_each(|l| l.intensity *= scale);
    set
}

fn trace_path(
    world: &World,
    emitters: &Emitters,
    mut sequence: Sequence,
    bounces: u32,
    normal_maps: bool,
) -> Vec<Vpl> {
    let mut lights = Vec::new();
    let Some(emitted) = emitters.emit(world, &mut sequence) else { return lights };
    let mut ray = Ray { origin: emitted.origin, direction: emitted.direction, t_max: f32::MAX };
    let mut flux = emitted.flux;
    for _ in 0..bounces {
        if flux.max_element() <= 0.0 {
            break;
        }
        let Some(hit) = world.closest(&ray) else { break };
        let surface = world.surface(&hit, ray.direction, normal_maps);
        // Flux arrives by the geometric cosine, reflection asks for the shading one.
        let correction =
            surface.ns.dot(ray.direction).min(0.0) / surface.ng.dot(ray.direction).min(-1e-6);
        flux *= surface.albedo * correction.min(MAX_NORMAL_CORRECTION);
        if flux.max_element() <= 0.0 || !flux.is_finite() {
            break;
        }
        lights.push(Vpl { position: surface.position, normal: surface.ng, intensity: flux / PI });

        // Russian roulette on the albedo.
        let survival = surface.albedo.max_element().min(1.0);
        if sequence.next_1d() >= survival {
            break;
        }
        flux /= survival;
        let direction = cosine_hemisphere(surface.ng, sequence.next_2d());
        ray = Ray { origin: surface.ray_origin(world), direction, t_max: f32::MAX };
    }
    lights
}

/// Bounce-0 lights: `count` points on the emissive triangles, in proportion to flux.
pub fn trace_emitters(world: &World, emitters: &Emitters, count: u32, seed: u32) -> VplSet {
    let light = |j: u32| {
        let mut sequence = Sequence::new(seed, j);
        let ([choose, side], point) = (sequence.next_2d(), sequence.next_2d());
        let sample = emitters.surface.sample(world, choose, point)?;
        let (normal, sides) = match sample.double_sided {
            true if side < 0.5 => (-sample.normal, 2.0),
            true => (sample.normal, 2.0),
            false => (sample.normal, 1.0),
        };
        let intensity = sample.radiance * (sides / (sample.pdf_area * count as f32));
        let valid = intensity.is_finite() && intensity.max_element() > 0.0;
        valid.then_some(Vpl { position: sample.position, normal, intensity })
    };
    let count = if emitters.surface.is_empty() { 0 } else { count };
    let lights = (0..count).into_par_iter().with_min_len(1024).filter_map(light).collect();
    VplSet { lights, path_count: u64::from(count) }
}

impl VplSet {
    /// Sum of the intensities of all lights, W·sr⁻¹.
    pub fn total_intensity(&self) -> Vec3 {
        self.lights.iter().map(|l| l.intensity).sum()
    }
}

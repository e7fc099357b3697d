//! The judge: an unbiased path tracer over the same scene, light by light.
//!
//! In: world, emitters, camera · Out: direct, indirect and emitted radiance per pixel
//! Next-event estimation with multiple importance sampling (power heuristic, `[VeachGuibas95]`).
//! A bounce limit of n covers the light paths that virtual lights of n bounces cover: at most
//! n + 1 surfaces between light and eye.

#[cfg(feature = "gpu")]
pub mod gpu;

use crate::bvh::Ray;
use crate::direct;
use crate::emitter::{Emitters, SurfaceSample};
use crate::math::{Sequence, cosine_hemisphere};
use crate::shadow;
use crate::surface::{SurfacePoint, ViewFrame};
use crate::world::{Hit, World};
use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Tells the seeds of pixels from those of other things with the same index.
pub(crate) const PIXEL_KEY: u32 = 0x3c6e_f372;

/// Radiance of one camera path, split by the length of the light's way.
#[derive(Clone, Copy, Debug, Default)]
pub struct PathSample {
    /// What the camera sees shine.
    pub emission: Vec3,
    /// One surface between light and eye.
    pub direct: Vec3,
    /// Two or more.
    pub indirect: Vec3,
}

/// What a path tracer needs besides the random numbers.
#[derive(Clone, Copy, Debug)]
pub struct PathTracer<'a> {
    /// Geometry.
    pub world: &'a World,
    /// Light.
    pub emitters: &'a Emitters,
    /// Reflections between the first surface and the light, as for virtual lights.
    pub bounces: u32,
    /// Whether normal textures bend normals.
    pub normal_maps: bool,
}

impl PathTracer<'_> {
    /// Traces one path through a point of pixel (x, y), jittered over the pixel's area.
    pub fn trace(&self, view: &ViewFrame, x: usize, y: usize, mut seq: Sequence) -> PathSample {
        let [dx, dy] = seq.next_2d();
        let mut ray = view.ray(Vec2::new(x as f32 + dx, y as f32 + dy));
        let mut sample = PathSample::default();
        let Some(hit) = self.world.closest(&ray) else {
            sample.emission = self.sky(ray.direction);
            return sample;
        };
        let mut surface = self.world.surface(&hit, ray.direction, self.normal_maps);
        sample.emission = surface.emission;
        let mut throughput = Vec3::ONE;
        for vertex in 0..=self.bounces {
            if surface.albedo == Vec3::ZERO {
                break;
            }
            throughput *= surface.albedo;
            let layer = if vertex == 0 { &mut sample.direct } else { &mut sample.indirect };
            *layer += throughput / PI * self.next_event(&surface, &mut seq);

            // One reflection finds emitters and the sky a second way, and the next surface.
            let direction = cosine_hemisphere(surface.ns, seq.next_2d());
            // Below the surface itself: blocked, as for shadow rays.
            if surface.ng.dot(direction) <= 0.0 {
                break;
            }
            ray = Ray { origin: surface.ray_origin(self.world), direction, t_max: f32::MAX };
            let pdf_sa = surface.ns.dot(direction).max(0.0) / PI;
            let Some(hit) = self.world.closest(&ray) else {
                *layer += throughput * self.sky(direction) * self.sky_weight(direction, pdf_sa);
                break;
            };
            let next = self.world.surface(&hit, direction, self.normal_maps);
            if next.emission != Vec3::ZERO && !next.unlit {
                let weight = self.emitter_weight(&hit, &next, &ray, pdf_sa);
                *layer += throughput * next.emission * weight;
            }
            surface = next;
        }
        sample
    }

    /// Irradiance by looking for the light: all kinds of sources.
    fn next_event(&self, surface: &SurfacePoint, seq: &mut Sequence) -> Vec3 {
        let mut sum = direct::from_lights(self.world, self.emitters, surface, seq);
        if !self.emitters.surface.is_empty() {
            let (choose, u) = (seq.next_1d(), seq.next_2d());
            let found = self.emitters.surface.sample(self.world, choose, u);
            sum += found.map_or(Vec3::ZERO, |s| self.emitter_irradiance(surface, &s));
        }
        let is_map = matches!(self.world.scene.sky, Some(manylight_scene::Sky::Map(_)));
        if let (Some(sky), true) = (&self.emitters.sky, is_map) {
            let (direction, radiance, pdf_sa) = sky.sample(seq.next_2d());
            let cos = surface.ns.dot(direction).max(0.0);
            if cos > 0.0 && shadow::is_open(self.world, surface, direction, f32::INFINITY) {
                sum += radiance * (cos / pdf_sa * power_heuristic(pdf_sa, cos / PI));
            }
        }
        sum
    }

    fn emitter_irradiance(&self, surface: &SurfacePoint, s: &SurfaceSample) -> Vec3 {
        let offset = s.position - surface.position;
        let dist_sq = offset.length_squared();
        let Some(direction) = offset.try_normalize() else { return Vec3::ZERO };
        let facing = -s.normal.dot(direction);
        let cos_light = if s.double_sided { facing.abs() } else { facing };
        let cos = surface.ns.dot(direction);
        if cos <= 0.0 || cos_light <= 0.0 || s.radiance == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let normal = if facing > 0.0 { s.normal } else { -s.normal };
        if !shadow::is_seen(self.world, surface, s.position, normal) {
            return Vec3::ZERO;
        }
        let pdf_sa = s.pdf_area * dist_sq / cos_light;
        s.radiance * (cos / pdf_sa * power_heuristic(pdf_sa, cos / PI))
    }

    /// Weight of an emitter met by reflection.
    fn emitter_weight(&self, hit: &Hit, next: &SurfacePoint, ray: &Ray, pdf_sa: f32) -> f32 {
        let pdf_area = self.emitters.surface.pdf_area(hit.instance, hit.triangle);
        let cos_light = next.ng.dot(ray.direction).abs();
        let dist_sq = (next.position - ray.origin).length_squared();
        power_heuristic(pdf_sa, pdf_area * dist_sq / cos_light.max(1e-9))
    }

    fn sky(&self, direction: Vec3) -> Vec3 {
        self.emitters.sky.as_ref().map_or(Vec3::ZERO, |s| s.radiance(direction))
    }

    /// Weight of the sky met by reflection: all of it for a constant sky.
    fn sky_weight(&self, direction: Vec3, pdf_sa: f32) -> f32 {
        match (&self.world.scene.sky, &self.emitters.sky) {
            (Some(manylight_scene::Sky::Map(_)), Some(sky)) => {
                power_heuristic(pdf_sa, sky.pdf_sa(direction))
            }
            _ => 1.0,
        }
    }
}

/// Weight of a sample of density `own` where another strategy has density `other`.
fn power_heuristic(own: f32, other: f32) -> f32 {
    if own <= 0.0 { 0.0 } else { 1.0 / (1.0 + (other / own) * (other / own)) }
}

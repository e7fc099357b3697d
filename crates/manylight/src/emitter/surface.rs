//! Emissive triangles as one source.

use super::EmittedRay;
use crate::math::{Discrete, cosine_hemisphere, luminance, uniform_triangle};
use crate::world::World;
use glam::Vec3;
use std::collections::HashMap;
use std::f32::consts::PI;

/// Every triangle that shines, chosen by its flux.
#[derive(Clone, Debug)]
pub struct SurfaceEmitter {
    pub(super) triangles: Vec<EmissiveTriangle>,
    pub(super) by_flux: Discrete,
    /// Instance → position of its first triangle in `triangles`.
    pub(super) first_of_instance: HashMap<u32, u32>,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct EmissiveTriangle {
    pub instance: u32,
    pub triangle: u32,
    pub area: f32,
    /// Emits on both sides.
    pub double_sided: bool,
}

/// A point on an emissive triangle.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceSample {
    /// World position.
    pub position: Vec3,
    /// Unit normal of the front side.
    pub normal: Vec3,
    /// Radiance on the emitting sides.
    pub radiance: Vec3,
    /// Density over the area of all emissive triangles, m⁻².
    pub pdf_area: f32,
    /// Emits on both sides.
    pub double_sided: bool,
}

impl SurfaceEmitter {
    /// Collects the emissive triangles of a world.
    pub fn new(world: &World) -> Self {
        let mut emitter = Self {
            triangles: Vec::new(),
            by_flux: Discrete::default(),
            first_of_instance: HashMap::new(),
        };
        let mut fluxes = Vec::new();
        for instance in 0..world.scene.instances.len() as u32 {
            let material = world.material_of(instance);
            if material.emission.max_element() <= 0.0 || material.unlit {
                continue;
            }
            emitter.first_of_instance.insert(instance, emitter.triangles.len() as u32);
            for triangle in 0..world.mesh_of(instance).triangles.len() as u32 {
                let [a, b, c] = world.corners(instance, triangle);
                let area = (b - a).cross(c - a).length() * 0.5;
                let area = if area.is_finite() { area } else { 0.0 };
                let double_sided = material.double_sided;
                emitter.triangles.push(EmissiveTriangle { instance, triangle, area, double_sided });
                let sides = if double_sided { 2.0 } else { 1.0 };
                fluxes.push(PI * area * sides * mean_luminance(world, instance, triangle));
            }
        }
        emitter.by_flux = Discrete::new(fluxes);
        emitter
    }

    /// Luminance of the flux of all triangles, W.
    pub fn flux(&self) -> f32 {
        self.by_flux.total() as f32
    }

    /// Whether no triangle shines.
    pub fn is_empty(&self) -> bool {
        self.by_flux.total() <= 0.0
    }

    /// Draws a point in proportion to flux.
    pub fn sample(&self, world: &World, choose: f32, u: [f32; 2]) -> Option<SurfaceSample> {
        let index = self.by_flux.sample(choose)?;
        let t = self.triangles[index];
        let [u, v] = uniform_triangle(u);
        let [a, b, c] = world.corners(t.instance, t.triangle);
        // Texels that are cut out do not shine.
        let present = world.presence(t.instance, t.triangle, [u, v]);
        Some(SurfaceSample {
            position: a + (b - a) * u + (c - a) * v,
            normal: world.front_normal(t.instance, t.triangle),
            radiance: world.emission(t.instance, t.triangle, [u, v]) * present,
            pdf_area: self.by_flux.pmf(index) / t.area,
            double_sided: t.double_sided,
        })
    }

    /// Density with which `sample` finds a point of this triangle, m⁻²; 0 where it never does.
    pub fn pdf_area(&self, instance: u32, triangle: u32) -> f32 {
        let Some(first) = self.first_of_instance.get(&instance) else { return 0.0 };
        let index = (first + triangle) as usize;
        let area = self.triangles[index].area;
        if area > 0.0 { self.by_flux.pmf(index) / area } else { 0.0 }
    }

    /// Sends a ray from a random point, cosine-distributed.
    pub(super) fn emit(
        &self,
        world: &World,
        choose: f32,
        u: [f32; 2],
        w: [f32; 2],
    ) -> Option<EmittedRay> {
        let s = self.sample(world, choose, u)?;
        // A double-sided emitter uses the second number for the side as well.
        let (normal, sides, w) = match (s.double_sided, w[0] < 0.5) {
            (false, _) => (s.normal, 1.0, w),
            (true, true) => (s.normal, 2.0, [w[0] * 2.0, w[1]]),
            (true, false) => (-s.normal, 2.0, [w[0] * 2.0 - 1.0, w[1]]),
        };
        Some(EmittedRay {
            origin: s.position + normal * world.ray_offset(s.position),
            direction: cosine_hemisphere(normal, w),
            flux: s.radiance * (PI * sides / s.pdf_area),
        })
    }
}

/// Mean luminance over a few points of a triangle: exact without texture, a guide with one.
fn mean_luminance(world: &World, instance: u32, triangle: u32) -> f32 {
    if world.material_of(instance).emission_texture.is_none() {
        return luminance(world.material_of(instance).emission);
    }
    const STEPS: u32 = 4;
    let center = |i: u32| (i as f32 + 0.5) / STEPS as f32;
    let sum: f32 = (0..STEPS * STEPS)
        .map(|i| uniform_triangle([center(i % STEPS), center(i / STEPS)]))
        .map(|uv| luminance(world.emission(instance, triangle, uv)))
        .sum();
    // Never zero, so that a bright texel between the probes is still found.
    let mean = sum / (STEPS * STEPS) as f32;
    mean.max(1e-3 * luminance(world.material_of(instance).emission))
}

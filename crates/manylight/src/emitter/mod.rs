//! Real sources of light: choosing one, sending a ray from it, and what it gives a point.
//!
//! In: [`World`] · Out: [`Emitters`], [`EmittedRay`], [`DirectSample`]
//! Units: flux W, radiance W·m⁻²·sr⁻¹, pdf_sa sr⁻¹

#[cfg(feature = "gpu")]
pub mod gpu;
mod sky;
mod surface;

pub use sky::SkyEmitter;
pub use surface::{SurfaceEmitter, SurfaceSample};

use crate::math::{Discrete, Sequence, luminance, uniform_cone, uniform_sphere};
use crate::world::World;
use glam::Vec3;
use manylight_scene::{Light, Sky};
use std::f32::consts::PI;

/// All sources of a scene with the distributions that choose among them.
#[derive(Debug)]
pub struct Emitters {
    /// Sun, point and spot lights: few and exact.
    pub lights: Vec<Light>,
    /// Triangles that shine.
    pub surface: SurfaceEmitter,
    /// Light from infinity.
    pub sky: Option<SkyEmitter>,
    /// Over `lights`, then surface, then sky, by flux.
    by_flux: Discrete,
}

/// A ray that carries flux away from a source.
#[derive(Clone, Copy, Debug)]
pub struct EmittedRay {
    /// Start, clear of the source.
    pub origin: Vec3,
    /// Unit.
    pub direction: Vec3,
    /// Flux of this ray if it were the only one, W.
    pub flux: Vec3,
}

/// Light from a source without a surface at a point, before visibility.
#[derive(Clone, Copy, Debug)]
pub struct DirectSample {
    /// Unit, toward the source.
    pub direction: Vec3,
    /// To the source, metres; infinite for a sun.
    pub distance: f32,
    /// On a surface facing the source, W·m⁻².
    pub irradiance: Vec3,
}

impl Emitters {
    /// Collects the sources of a world.
    pub fn new(world: &World) -> Self {
        Self::with_surface(world, SurfaceEmitter::new(world))
    }

    /// The same where the triangles that shine are known.
    pub(crate) fn with_surface(world: &World, surface: SurfaceEmitter) -> Self {
        let sky = world.scene.sky.as_ref().and_then(|s: &Sky| SkyEmitter::new(s));
        let lights = world.scene.lights.clone();
        let flux = |light: &Light| match *light {
            Light::Sun { direction, irradiance } => {
                luminance(irradiance) * box_area_toward(world.bounds, direction)
            }
            Light::Point { intensity, .. } => luminance(intensity) * 4.0 * PI,
            Light::Spot { intensity, cos_outer, cos_inner, .. } => {
                // ∫ of the squared ramp over the edge is a third of its width in cosθ.
                luminance(intensity) * 2.0 * PI * (1.0 - cos_inner + (cos_inner - cos_outer) / 3.0)
            }
        };
        let sky_flux = sky.as_ref().map_or(0.0, |s| {
            // Mean projected area of a convex body is a quarter of its surface.
            let size = world.bounds[1] - world.bounds[0];
            let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
            luminance(s.mean_radiance()) * 4.0 * PI * area * 0.25
        });
        let weights: Vec<f32> = lights.iter().map(flux).chain([surface.flux(), sky_flux]).collect();
        Self { lights, surface, sky, by_flux: Discrete::new(weights) }
    }

    /// Whether anything shines.
    pub fn is_dark(&self) -> bool {
        self.by_flux.total() <= 0.0
    }

    /// Sends one ray; its flux is divided by the probability of everything drawn.
    ///
    /// Returns `None` where nothing shines or the draw carries no light.
    pub fn emit(&self, world: &World, sequence: &mut Sequence) -> Option<EmittedRay> {
        let [choose, extra] = sequence.next_2d();
        let (a, b) = (sequence.next_2d(), sequence.next_2d());
        let index = self.by_flux.sample(choose)?;
        let pmf = self.by_flux.pmf(index);
        let ray = match self.lights.get(index) {
            Some(&Light::Sun { direction, irradiance }) => {
                let (origin, area) = point_on_box(world.bounds, direction, extra, a);
                Some(EmittedRay { origin, direction, flux: irradiance * area })
            }
            Some(&Light::Point { position, intensity }) => {
                let direction = uniform_sphere(a);
                Some(EmittedRay { origin: position, direction, flux: intensity * (4.0 * PI) })
            }
            Some(&Light::Spot { position, direction: axis, intensity, cos_outer, cos_inner }) => {
                let direction = uniform_cone(axis, cos_outer, a);
                let fade = spot_fade(direction.dot(axis), cos_outer, cos_inner);
                let flux = intensity * (fade * 2.0 * PI * (1.0 - cos_outer));
                Some(EmittedRay { origin: position, direction, flux })
            }
            None if index == self.lights.len() => self.surface.emit(world, extra, a, b),
            None => self.sky.as_ref().map(|sky| {
                let (toward_sky, radiance, pdf_sa) = sky.sample(b);
                let (origin, area) = point_on_box(world.bounds, -toward_sky, extra, a);
                EmittedRay { origin, direction: -toward_sky, flux: radiance * (area / pdf_sa) }
            }),
        }?;
        Some(EmittedRay { flux: ray.flux / pmf, ..ray })
    }

    /// What light `index` gives point `p`; `None` where it gives nothing.
    pub fn direct(&self, index: usize, p: Vec3) -> Option<DirectSample> {
        match self.lights[index] {
            Light::Sun { direction, irradiance } => {
                Some(DirectSample { direction: -direction, distance: f32::INFINITY, irradiance })
            }
            Light::Point { position, intensity } => at_distance(p, position, |_| intensity),
            Light::Spot { position, direction, intensity, cos_outer, cos_inner } => {
                at_distance(p, position, |toward| {
                    intensity * spot_fade(-toward.dot(direction), cos_outer, cos_inner)
                })
            }
        }
    }
}

/// Irradiance from a point source of the given intensity toward `p`.
fn at_distance(p: Vec3, position: Vec3, intensity: impl Fn(Vec3) -> Vec3) -> Option<DirectSample> {
    let distance = (position - p).length();
    let direction = (position - p).try_normalize()?;
    let irradiance = intensity(direction) / (distance * distance);
    (irradiance.is_finite() && irradiance != Vec3::ZERO).then_some(DirectSample {
        direction,
        distance,
        irradiance,
    })
}

/// Share of a spot's intensity at an angle from its axis (KHR_lights_punctual).
fn spot_fade(cos_theta: f32, cos_outer: f32, cos_inner: f32) -> f32 {
    let ramp = (cos_theta - cos_outer) / (cos_inner - cos_outer).max(1e-6);
    ramp.clamp(0.0, 1.0).powi(2)
}

/// Projected area of a box along a direction, m².
fn box_area_toward(bounds: [Vec3; 2], direction: Vec3) -> f32 {
    let size = bounds[1] - bounds[0];
    let faces = Vec3::new(size.y * size.z, size.z * size.x, size.x * size.y);
    faces.dot(direction.abs())
}

/// A point where parallel rays enter the (slightly widened) box, uniform over its projection.
///
/// Returns the point and the projected area.
fn point_on_box(bounds: [Vec3; 2], direction: Vec3, choose: f32, u: [f32; 2]) -> (Vec3, f32) {
    let margin = (bounds[1] - bounds[0]).max_element() * 1e-4 + 1e-6;
    let (low, high) = (bounds[0] - margin, bounds[1] + margin);
    let size = high - low;
    let faces = Vec3::new(size.y * size.z, size.z * size.x, size.x * size.y) * direction.abs();
    let total = faces.element_sum();
    let target = choose * total;
    let axis = if target < faces.x { 0 } else { 1 + usize::from(target >= faces.x + faces.y) };
    let mut p = low;
    p[axis] = if direction[axis] > 0.0 { low[axis] } else { high[axis] };
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    p[b] += u[0] * size[b];
    p[c] += u[1] * size[c];
    (p, total)
}

#[cfg(test)]
mod tests;

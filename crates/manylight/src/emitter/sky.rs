//! Light from infinity.

use crate::math::{Discrete, luminance, sin_cos_turns, uniform_sphere};
use glam::Vec3;
use manylight_scene::{Sky, SkyMap};
use std::f32::consts::PI;

/// A sky with the distribution that chooses directions from it.
#[derive(Debug)]
pub struct SkyEmitter {
    sky: Sky,
    /// Over texels, by luminance and solid angle; unused for a constant sky.
    pub(super) by_flux: Discrete,
    mean: Vec3,
}

impl SkyEmitter {
    /// `None` for a black sky.
    pub fn new(sky: &Sky) -> Option<Self> {
        let (by_flux, mean) = match sky {
            Sky::Constant(radiance) => (Discrete::default(), *radiance),
            Sky::Map(map) => {
                let weight = |i: usize| texel_solid_angle(map, i / map.width as usize);
                let texels = || map.radiance.iter().enumerate();
                let sum: Vec3 = texels().map(|(i, r)| *r * weight(i)).sum();
                let by_flux = Discrete::new(texels().map(|(i, r)| luminance(*r) * weight(i)));
                (by_flux, sum / (4.0 * PI))
            }
        };
        (mean.max_element() > 0.0).then(|| Self { sky: sky.clone(), by_flux, mean })
    }

    /// Average over all directions, W·m⁻²·sr⁻¹.
    pub fn mean_radiance(&self) -> Vec3 {
        self.mean
    }

    /// Radiance from a direction (unit, toward the sky).
    pub fn radiance(&self, toward_sky: Vec3) -> Vec3 {
        match &self.sky {
            Sky::Constant(radiance) => *radiance,
            Sky::Map(map) => map.radiance[texel_of(map, toward_sky)],
        }
    }

    /// A direction, its radiance and its pdf_sa.
    pub fn sample(&self, u: [f32; 2]) -> (Vec3, Vec3, f32) {
        match &self.sky {
            Sky::Constant(radiance) => (uniform_sphere(u), *radiance, 0.25 / PI),
            Sky::Map(map) => {
                let index = self.by_flux.sample(u[0]).unwrap_or(0);
                let (x, y) = (index % map.width as usize, index / map.width as usize);
                // What the search left of u[0] places the direction inside the texel.
                let below = if index == 0 { 0.0 } else { self.by_flux.cumulative_at(index - 1) };
                let step = self.by_flux.cumulative_at(index) - below;
                let left = ((f64::from(u[0]) * self.by_flux.total() - below) / step) as f32;
                let direction = direction_of(map, x as f32 + left.clamp(0.0, 1.0), y, u[1]);
                let pdf_sa = self.by_flux.pmf(index) / texel_solid_angle(map, y);
                (direction, map.radiance[index], pdf_sa)
            }
        }
    }

    /// Density of `sample` at a direction, sr⁻¹.
    pub fn pdf_sa(&self, toward_sky: Vec3) -> f32 {
        match &self.sky {
            Sky::Constant(_) => 0.25 / PI,
            Sky::Map(map) => {
                let index = texel_of(map, toward_sky);
                self.by_flux.pmf(index) / texel_solid_angle(map, index / map.width as usize)
            }
        }
    }
}

/// cosθ of a row's upper edge.
pub(super) fn row_cos(map: &SkyMap, row: f32) -> f32 {
    (PI * row / map.height as f32).cos()
}

fn texel_solid_angle(map: &SkyMap, row: usize) -> f32 {
    let band = row_cos(map, row as f32) - row_cos(map, row as f32 + 1.0);
    band * 2.0 * PI / map.width as f32
}

/// The direction of a column coordinate and a share 0…1 of a row's solid angle.
fn direction_of(map: &SkyMap, column: f32, row: usize, share: f32) -> Vec3 {
    let (top, bottom) = (row_cos(map, row as f32), row_cos(map, row as f32 + 1.0));
    let cos = top + (bottom - top) * share;
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let turns = column / map.width as f32 - map.rotation_rad / (2.0 * PI);
    let (sin_phi, cos_phi) = sin_cos_turns(turns - turns.floor());
    Vec3::new(-sin * cos_phi, cos, -sin * sin_phi)
}

fn texel_of(map: &SkyMap, direction: Vec3) -> usize {
    let phi = (-direction.z).atan2(-direction.x) + map.rotation_rad;
    let column = (phi / (2.0 * PI)).rem_euclid(1.0) * map.width as f32;
    let row = direction.y.clamp(-1.0, 1.0).acos() / PI * map.height as f32;
    let column = (column as usize).min(map.width as usize - 1);
    (row as usize).min(map.height as usize - 1) * map.width as usize + column
}

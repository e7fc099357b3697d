//! Turning gathered irradiance into radiance layers.

use crate::composite::Layers;
use crate::gather::Gathered;
use glam::Vec3;
use std::f32::consts::PI;

impl Layers {
    /// direct = albedo/π · irradiance.
    pub(crate) fn set_direct(&mut self, irradiance: &[Vec3]) {
        for (i, e) in irradiance.iter().enumerate() {
            self.direct[i] = self.albedo[i] / PI * *e;
        }
    }

    /// direct += albedo/π · what arrives.
    pub(crate) fn add_direct(&mut self, g: &Gathered) {
        for i in 0..g.unshadowed.len() {
            self.direct[i] += self.albedo[i] / PI * g.arriving(i);
            self.evals[i] += g.evals[i] as f32;
        }
    }

    /// indirect = albedo/π · what arrives.
    pub(crate) fn set_indirect(&mut self, g: &Gathered) {
        for i in 0..g.unshadowed.len() {
            let brdf = self.albedo[i] / PI;
            self.indirect_unshadowed[i] = brdf * g.unshadowed[i];
            self.indirect[i] = brdf * g.arriving(i);
            self.shadow_ratio[i] = g.shadow_ratio[i];
            self.evals[i] += g.evals[i] as f32;
        }
    }
}

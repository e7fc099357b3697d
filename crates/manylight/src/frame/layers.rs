//! Turning gathered irradiance into radiance layers.

use crate::composite::Layers;
use crate::gather::Gathered;
use crate::math::luminance;
use glam::Vec3;
use std::f32::consts::PI;

impl Layers {
    /// direct = albedo/π · irradiance.
    pub(super) fn set_direct(&mut self, irradiance: &[Vec3]) {
        for (i, e) in irradiance.iter().enumerate() {
            self.direct[i] = self.albedo[i] / PI * *e;
        }
    }

    /// direct += albedo/π · unshadowed · ratio.
    pub(super) fn add_direct(&mut self, g: &Gathered) {
        for i in 0..g.unshadowed.len() {
            self.direct[i] += self.albedo[i] / PI * g.unshadowed[i] * g.shadow_ratio[i];
            self.evals[i] += g.evals[i] as f32;
        }
    }

    /// indirect = albedo/π · unshadowed · ratio.
    pub(super) fn set_indirect(&mut self, g: &Gathered) {
        for i in 0..g.unshadowed.len() {
            let unshadowed = self.albedo[i] / PI * g.unshadowed[i];
            self.indirect_unshadowed[i] = unshadowed;
            self.indirect[i] = unshadowed * g.shadow_ratio[i];
            self.shadow_ratio[i] = g.shadow_ratio[i];
            self.evals[i] += g.evals[i] as f32;
        }
    }
}

impl Gathered {
    /// Stores a shadowed sum: its color as it is, its luminance as the ratio.
    pub(super) fn set_shadowed(&mut self, i: usize, shadowed: Vec3) {
        let ratio = luminance(shadowed) / luminance(self.unshadowed[i]).max(f32::MIN_POSITIVE);
        self.shadow_ratio[i] = ratio;
        // The product of both must be the true sum in every channel.
        if ratio > 0.0 {
            self.unshadowed[i] = shadowed / ratio;
        }
    }
}

//! Adding the parts of the picture.
//!
//! In: direct and indirect irradiance, ratio, receivers · Out: [`Layers`]

#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(feature = "gpu")]
pub mod store;
#[cfg(feature = "gpu")]
pub mod tone;

use crate::surface::Receivers;
use glam::Vec3;

/// The picture and everything it was made of, row-major from the top.
#[derive(Clone, Debug, Default)]
pub struct Layers {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Reflected light straight from its source, W·m⁻²·sr⁻¹.
    pub direct: Vec<Vec3>,
    /// Reflected light that was scattered before, W·m⁻²·sr⁻¹.
    pub indirect: Vec<Vec3>,
    /// The same without visibility.
    pub indirect_unshadowed: Vec<Vec3>,
    /// Share of the latter that arrives.
    pub shadow_ratio: Vec<f32>,
    /// What the camera sees shine, the sky included.
    pub emission: Vec<Vec3>,
    /// Diffuse reflectance.
    pub albedo: Vec<Vec3>,
    /// Unit shading normal, world.
    pub normal: Vec<Vec3>,
    /// World position.
    pub position: Vec<Vec3>,
    /// Distance along the viewing axis, metres; infinite where nothing was met.
    pub depth: Vec<f32>,
    /// Lights evaluated.
    pub evals: Vec<f32>,
}

impl Layers {
    /// Layers that know the receivers and no light yet.
    pub fn new(receivers: &Receivers, sky: impl Fn(Vec3) -> Vec3) -> Self {
        let n = receivers.samples.len();
        let mut layers = Self {
            width: receivers.width,
            height: receivers.height,
            direct: vec![Vec3::ZERO; n],
            indirect: vec![Vec3::ZERO; n],
            indirect_unshadowed: vec![Vec3::ZERO; n],
            shadow_ratio: vec![1.0; n],
            emission: vec![Vec3::ZERO; n],
            albedo: vec![Vec3::ZERO; n],
            normal: vec![Vec3::ZERO; n],
            position: vec![Vec3::ZERO; n],
            depth: vec![f32::INFINITY; n],
            evals: vec![0.0; n],
        };
        for (i, sample) in receivers.samples.iter().enumerate() {
            layers.depth[i] = sample.depth;
            match &sample.surface {
                None => layers.emission[i] = sky(sample.direction),
                Some(s) => {
                    layers.emission[i] = s.emission;
                    layers.albedo[i] = s.albedo;
                    layers.normal[i] = s.ns;
                    layers.position[i] = s.position;
                }
            }
        }
        layers
    }

    /// The picture: direct + indirect + emission.
    pub fn beauty(&self) -> Vec<Vec3> {
        let parts = self.direct.iter().zip(&self.indirect).zip(&self.emission);
        parts.map(|((d, i), e)| *d + *i + *e).collect()
    }

    /// Adds `other` with a weight; normal, position and depth keep the first sample.
    pub fn add_weighted(&mut self, other: &Self, weight: f32) {
        let colors = [
            (&mut self.direct, &other.direct),
            (&mut self.indirect, &other.indirect),
            (&mut self.indirect_unshadowed, &other.indirect_unshadowed),
            (&mut self.emission, &other.emission),
            (&mut self.albedo, &other.albedo),
        ];
        for (sum, part) in colors {
            sum.iter_mut().zip(part).for_each(|(a, b)| *a += *b * weight);
        }
        for (sum, part) in
            [(&mut self.shadow_ratio, &other.shadow_ratio), (&mut self.evals, &other.evals)]
        {
            sum.iter_mut().zip(part).for_each(|(a, b)| *a += *b * weight);
        }
    }

    /// All layers but normal, position and depth scaled, as the start of a weighted sum.
    pub fn scaled(mut self, weight: f32) -> Self {
        let colors = [
            &mut self.direct,
            &mut self.indirect,
            &mut self.indirect_unshadowed,
            &mut self.emission,
            &mut self.albedo,
        ];
        colors.into_iter().flatten().for_each(|v| *v *= weight);
        [&mut self.shadow_ratio, &mut self.evals].into_iter().flatten().for_each(|v| *v *= weight);
        self
    }
}

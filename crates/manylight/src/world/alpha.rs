//! Which texels of a surface are there for a ray.

use super::World;
use crate::bvh::Ray;
use crate::math::{hash_u32, unit_f32};
use manylight_scene::{AlphaMode, Material};

/// Whether a ray may pass some of a material.
pub(super) fn has_holes(material: &Material) -> bool {
    match material.alpha_mode {
        AlphaMode::Opaque => false,
        AlphaMode::Mask(_) | AlphaMode::Blend => true,
    }
}

impl World {
    /// Opacity of a triangle at a point: texture, factor and vertex color.
    pub fn opacity(&self, instance: u32, triangle: u32, barycentrics: [f32; 2]) -> f32 {
        let mesh = self.mesh_of(instance);
        let material = &self.scene.materials[mesh.material as usize];
        let corners = mesh.triangles[triangle as usize];
        let mut opacity = material.base_color.w;
        if let Some(slot) = &material.base_color_texture {
            let uv = self.uv(mesh, slot, corners, barycentrics);
            opacity *= super::sample_rgba(&self.scene.images, slot, uv).w;
        }
        if !mesh.colors.is_empty() {
            let [a, b, c] = corners.map(|v| mesh.colors[v as usize].w);
            opacity *= a + (b - a) * barycentrics[0] + (c - a) * barycentrics[1];
        }
        opacity
    }

    /// Probability that a ray meets a triangle at a point.
    pub fn presence(&self, instance: u32, triangle: u32, barycentrics: [f32; 2]) -> f32 {
        match self.material_of(instance).alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask(cutoff) => {
                f32::from(u8::from(self.opacity(instance, triangle, barycentrics) >= cutoff))
            }
            AlphaMode::Blend => self.opacity(instance, triangle, barycentrics).clamp(0.0, 1.0),
        }
    }

    /// Whether a triangle stops this ray: masked texels by their cutoff, blended ones with the
    /// probability of their opacity, decided by a hash of ray and triangle.
    pub(super) fn stops(&self, ray: &Ray, instance: u32, triangle: u32, uv: [f32; 2]) -> bool {
        let presence = self.presence(instance, triangle, uv);
        if presence <= 0.0 || presence >= 1.0 {
            return presence > 0.0;
        }
        let words = [ray.origin, ray.direction]
            .into_iter()
            .flat_map(|v| v.to_array().map(f32::to_bits))
            .chain([instance, triangle]);
        let hash = words.fold(0x2545_f491, |h, word| hash_u32(h ^ word));
        unit_f32(hash) < presence
    }

    /// Texture coordinates of a point; zero where the mesh has none.
    #[inline]
    pub(crate) fn uv(
        &self,
        mesh: &manylight_scene::Mesh,
        slot: &manylight_scene::TextureSlot,
        corners: [u32; 3],
        [u, v]: [f32; 2],
    ) -> glam::Vec2 {
        let set = &mesh.uvs[usize::from(slot.uv_set).min(1)];
        if set.is_empty() {
            return glam::Vec2::ZERO;
        }
        let [a, b, c] = corners.map(|i| set[i as usize]);
        a + (b - a) * u + (c - a) * v
    }
}

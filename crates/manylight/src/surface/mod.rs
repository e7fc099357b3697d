//! What a ray finds on a surface, and the picture's receivers (the G-buffer).
//!
//! In: [`World`], camera · Out: [`SurfacePoint`], [`Receivers`]
//! Limits: Lambertian with the base color, whatever the metalness.

#[cfg(feature = "gpu")]
pub mod gpu;
mod receivers;

pub use receivers::{PixelSample, Receivers, ViewFrame};

use crate::world::{Hit, World, sample_rgba, sample_srgb};
use glam::{Vec2, Vec3};
use manylight_scene::{Material, Mesh, TextureSlot};

/// A point on a surface, seen from one side.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// World position.
    pub position: Vec3,
    /// Unit geometric normal on the side it is seen from.
    pub ng: Vec3,
    /// Unit shading normal, in the hemisphere of `ng`.
    pub ns: Vec3,
    /// Diffuse reflectance ρ, 0…1.
    pub albedo: Vec3,
    /// Radiance emitted toward this side, W·m⁻²·sr⁻¹.
    pub emission: Vec3,
    /// Whether `emission` is mere display (unlit material) and lights nothing.
    pub unlit: bool,
}

impl SurfacePoint {
    /// Start of a ray that leaves the surface on the seen side.
    #[inline]
    pub fn ray_origin(&self, world: &World) -> Vec3 {
        self.position + self.ng * world.ray_offset(self.position)
    }
}

/// A triangle that a ray met, looked up once.
struct Met<'a> {
    world: &'a World,
    mesh: &'a Mesh,
    material: &'a Material,
    instance: u32,
    /// Vertex indices.
    vertices: [u32; 3],
    /// Corners in the world.
    corners: [Vec3; 3],
    /// Unit normal of the front side.
    front: Vec3,
    barycentrics: [f32; 2],
}

impl World {
    /// Unit normal of the front side of a triangle (counter-clockwise corners in object space).
    pub fn front_normal(&self, instance: u32, triangle: u32) -> Vec3 {
        let mesh = self.mesh_of(instance);
        let positions = mesh.triangles[triangle as usize].map(|v| mesh.positions[v as usize]);
        self.front_normal_of(instance, positions, || self.corners(instance, triangle))
    }

    /// The same by its corners in object space, and in the world where those do not do.
    #[inline]
    fn front_normal_of(
        &self,
        instance: u32,
        [a, b, c]: [Vec3; 3],
        corners: impl FnOnce() -> [Vec3; 3],
    ) -> Vec3 {
        let normal = self.world_normal(instance, (b - a).cross(c - a));
        if normal != Vec3::ZERO {
            return normal;
        }
        // A singular transform has no cofactors left: take the flattened triangle itself.
        let [a, b, c] = corners();
        (b - a).cross(c - a).normalize_or(Vec3::Y)
    }

    /// Radiance emitted by a point of a triangle on its emitting sides; textures included.
    pub fn emission(&self, instance: u32, triangle: u32, barycentrics: [f32; 2]) -> Vec3 {
        let mesh = self.mesh_of(instance);
        let material = self.material_of(instance);
        let Some(slot) = &material.emission_texture else { return material.emission };
        let uv = self.uv(mesh, slot, mesh.triangles[triangle as usize], barycentrics);
        material.emission * sample_srgb(&self.scene.images, slot, uv).truncate()
    }

    /// Everything about the point a ray met.
    ///
    /// Space: `direction` is the ray's; normals face its origin
    pub fn surface(&self, hit: &Hit, direction: Vec3, normal_maps: bool) -> SurfacePoint {
        let met = Met::new(self, hit);
        let (mesh, material) = (met.mesh, met.material);
        let [u, v] = met.barycentrics;
        let [a, b, c] = met.corners;
        let position = a + (b - a) * u + (c - a) * v;

        // Normals, turned to the side the ray came from.
        let from_front = met.front.dot(direction) <= 0.0;
        let ng = if from_front { met.front } else { -met.front };
        let ns = met.shading_normal(normal_maps);
        let ns = if ns.dot(ng) < 0.0 { -ns } else { ns };

        // Color: factor, texture, vertex color.
        let mut color = material.base_color.truncate();
        if let Some(slot) = &material.base_color_texture {
            color *= sample_srgb(&self.scene.images, slot, met.uv(slot)).truncate();
        }
        if !mesh.colors.is_empty() {
            let [a, b, c] = met.vertices.map(|i| mesh.colors[i as usize].truncate());
            color *= a + (b - a) * u + (c - a) * v;
        }
        let color = color.clamp(Vec3::ZERO, Vec3::ONE);
        if material.unlit {
            let emission = color;
            return SurfacePoint { position, ng, ns, albedo: Vec3::ZERO, emission, unlit: true };
        }
        let emission = match from_front || material.double_sided {
            true => self.emission(hit.instance, hit.triangle, met.barycentrics),
            false => Vec3::ZERO,
        };
        SurfacePoint { position, ng, ns, albedo: color, emission, unlit: false }
    }
}

impl<'a> Met<'a> {
    fn new(world: &'a World, hit: &Hit) -> Self {
        let placed = &world.scene.instances[hit.instance as usize];
        let mesh = &world.scene.meshes[placed.mesh as usize];
        let vertices = mesh.triangles[hit.triangle as usize];
        let positions = vertices.map(|v| mesh.positions[v as usize]);
        let corners = positions.map(|p| placed.world_from_object.transform_point3(p));
        Self {
            world,
            mesh,
            material: &world.scene.materials[mesh.material as usize],
            instance: hit.instance,
            vertices,
            corners,
            front: world.front_normal_of(hit.instance, positions, || corners),
            barycentrics: hit.inside(),
        }
    }

    fn uv(&self, slot: &TextureSlot) -> Vec2 {
        self.world.uv(self.mesh, slot, self.vertices, self.barycentrics)
    }

    fn shading_normal(&self, normal_maps: bool) -> Vec3 {
        let [u, v] = self.barycentrics;
        let mut normal = self.front;
        if !self.mesh.normals.is_empty() {
            let [a, b, c] = self.vertices.map(|i| self.mesh.normals[i as usize]);
            let smooth = self.world.world_normal(self.instance, a + (b - a) * u + (c - a) * v);
            normal = if smooth == Vec3::ZERO { self.front } else { smooth };
        }
        match &self.material.normal_texture {
            Some(slot) if normal_maps => self.bend_normal(slot, normal),
            _ => normal,
        }
    }

    /// Applies a tangent-space normal map.
    fn bend_normal(&self, slot: &TextureSlot, n: Vec3) -> Vec3 {
        let images = &self.world.scene.images;
        let texel = sample_rgba(images, slot, self.uv(slot)).truncate() * 2.0 - 1.0;
        let (tangent, handedness) = if self.mesh.tangents.is_empty() {
            let Some(frame) = self.uv_tangent(slot) else { return n };
            frame
        } else {
            let [u, v] = self.barycentrics;
            let matrix = &self.world.scene.instances[self.instance as usize].world_from_object;
            let [a, b, c] = self.vertices.map(|i| self.mesh.tangents[i as usize]);
            let t = a + (b - a) * u + (c - a) * v;
            let mirrored = matrix.matrix3.determinant() < 0.0;
            let sign = if mirrored { -t.w } else { t.w };
            (matrix.transform_vector3(t.truncate()), sign)
        };
        let Some(tangent) = (tangent - n * n.dot(tangent)).try_normalize() else { return n };
        let bitangent = n.cross(tangent) * handedness.signum();
        let scale = self.material.normal_scale;
        (tangent * (texel.x * scale) + bitangent * (texel.y * scale) + n * texel.z)
            .try_normalize()
            .unwrap_or(n)
    }

    /// World tangent along +u and the handedness of the triangle's texture coordinates.
    fn uv_tangent(&self, slot: &TextureSlot) -> Option<(Vec3, f32)> {
        let set = &self.mesh.uvs[usize::from(slot.uv_set).min(1)];
        if set.is_empty() {
            return None;
        }
        let [a, b, c] = self.vertices.map(|i| set[i as usize]);
        let (d1, d2) = (b - a, c - a);
        let determinant = d1.perp_dot(d2);
        let [pa, pb, pc] = self.corners;
        let tangent = ((pb - pa) * d2.y - (pc - pa) * d1.y) * determinant.signum();
        // Rows of an image grow downward, the green channel points up: the bitangent follows −v.
        let world_front = (pb - pa).cross(pc - pa);
        let winding = if world_front.dot(self.front) < 0.0 { -1.0 } else { 1.0 };
        (determinant.abs() > 0.0).then_some((tangent, -determinant.signum() * winding))
    }
}

#[cfg(test)]
mod tests;

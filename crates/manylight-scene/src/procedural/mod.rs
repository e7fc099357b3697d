//! Scenes made by code: no files to fetch, the same on every machine.
//!
//! In: a name · Out: a [`Shot`] · Space: world, +Y up, metres · Limits: Lambertian surfaces only.
//! Outward winding is counter-clockwise; closed bodies are closed exactly, vertex on vertex.

mod shapes;
mod masonry;
mod furnishing;
mod cornell;
mod lamps;
mod atrium;
#[cfg(test)]
mod tests;

use glam::{Affine3A, Vec3};

use crate::{Camera, CameraPath, Instance, Material, Mesh, Scene, Shot};
use shapes::Shape;

/// The names that [`builtin`] knows, without the `builtin:` prefix.
pub const BUILTINS: &[&str] = &["cornell", "atrium", "many_lamps", "furnace"];

/// A procedural scene with its camera, or `None` for a name that is not in [`BUILTINS`].
///
/// Cost: below 0.2 s and 50 MB for the largest (`atrium`).
pub fn builtin(name: &str) -> Option<Shot> {
    match name {
        "cornell" => Some(cornell::build()),
        "atrium" => Some(atrium::build()),
        "many_lamps" => Some(lamps::build()),
        "furnace" => Some(furnace()),
        _ => None,
    }
}

/// A closed sphere of radius 1 with albedo ½ and emission ½, seen from its center.
///
/// The radiance is L = ½ + ½·L, so exactly 1 everywhere and in every direction. Flat normals,
/// because interpolated ones would break that identity.
fn furnace() -> Shot {
    let mut set = Assembly::new("furnace");
    let glow = set.material(Material {
        emission: Vec3::splat(0.5),
        ..Material::lambertian("glow", Vec3::splat(0.5))
    });
    let mut shape = Shape::default();
    shape.sphere(3, |p| p);
    shape.turn_inside_out();
    shape.flat_normals();
    let mesh = set.mesh("sphere", shape, glow);
    set.place(mesh, Affine3A::IDENTITY);
    set.shot(View { eye: Vec3::ZERO, target: Vec3::NEG_Z, vfov_deg: 90.0, size_px: [256, 256] })
}

/// Where a builtin's camera stands.
struct View {
    eye: Vec3,
    target: Vec3,
    vfov_deg: f32,
    size_px: [u32; 2],
}

/// A scene under construction.
struct Assembly {
    scene: Scene,
}

impl Assembly {
    fn new(name: &str) -> Self {
        Self { scene: Scene { name: format!("builtin:{name}"), ..Scene::default() } }
    }

    /// Adds a material and returns its index.
    fn material(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        self.scene.materials.len() as u32 - 1
    }

    /// Adds a Lambertian material of this linear albedo.
    fn lambertian(&mut self, name: &str, albedo: [f32; 3]) -> u32 {
        self.material(Material::lambertian(name, albedo.into()))
    }

    /// Adds a mesh and returns its index.
    fn mesh(&mut self, name: &str, shape: Shape, material: u32) -> u32 {
        self.scene.meshes.push(Mesh { name: name.to_owned(), material, ..shape.into_mesh() });
        self.scene.meshes.len() as u32 - 1
    }

    /// Puts one copy of a mesh into the world.
    fn place(&mut self, mesh: u32, world_from_object: Affine3A) {
        self.scene.instances.push(Instance { mesh, world_from_object });
    }

    /// Adds a mesh that stands where it was modelled.
    fn add(&mut self, name: &str, shape: Shape, material: u32) {
        let mesh = self.mesh(name, shape, material);
        self.place(mesh, Affine3A::IDENTITY);
    }

    fn shot(mut self, view: View) -> Shot {
        let camera = Camera::look_at(view.eye, view.target, Vec3::Y, view.vfov_deg.to_radians())
            .map(|c| Camera { name: "builtin".to_owned(), size_px: Some(view.size_px), ..c })
            .expect("builtin views are never straight up or down");
        self.scene.cameras.push(camera.clone());
        let (path, settings) = (CameraPath::default(), serde_json::Map::new());
        Shot { scene: self.scene, camera, path, settings, warnings: Vec::new(), files: Vec::new() }
    }
}

/// A number in 0…1 that depends on the key alone.
fn hash01(key: u32) -> f32 {
    let mut x = key.wrapping_mul(0x9E37_79B9) ^ 0x85EB_CA6B;
    for shift in [16, 13, 16] {
        x = (x ^ (x >> shift)).wrapping_mul(0xC2B2_AE35);
    }
    (x >> 8) as f32 / (1u32 << 24) as f32
}

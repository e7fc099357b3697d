//! The scene as data: what is where, and what shines.
//!
//! In: nothing · Out: [`Scene`], the one description every loader fills and every renderer reads.
//! Space: world, right-handed, +Y up, metres · Colors: linear Rec.709 · Units: SI radiometry.

use glam::{Affine3A, Vec2, Vec3, Vec4};

/// Everything a renderer needs to know of a scene.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Where it came from, for messages and metadata.
    pub name: String,
    /// Triangle meshes in their own space, each of one material.
    pub meshes: Vec<Mesh>,
    /// Placements of meshes in the world.
    pub instances: Vec<Instance>,
    /// Surface descriptions that [`Mesh::material`] points at.
    pub materials: Vec<Material>,
    /// Decoded images that [`TextureSlot::image`] points at.
    pub images: Vec<TextureImage>,
    /// Sun, point and spot lights. Area lights are emissive meshes.
    pub lights: Vec<Light>,
    /// Light from infinity, if any.
    pub sky: Option<Sky>,
    /// Cameras in file order.
    pub cameras: Vec<Camera>,
}

/// An indexed triangle mesh of one material (one glTF primitive).
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name for messages.
    pub name: String,
    /// Vertex positions `[n]`, object space.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals `[n]`; empty: flat shading.
    pub normals: Vec<Vec3>,
    /// Unit tangent and handedness in w `[n]`; empty: derived from the texture coordinates.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets, each `[n]` or empty.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA vertex colors `[n]`; empty: white.
    pub colors: Vec<Vec4>,
    /// Vertex indices of each triangle, all below n.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Scene::materials`].
    pub material: u32,
}

impl Mesh {
    /// Largest absolute coordinate along each axis, metres.
    pub(crate) fn reach(&self) -> Vec3 {
        self.positions.iter().fold(Vec3::ZERO, |reach, p| reach.max(p.abs()))
    }
}

/// One placement of a mesh.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// May mirror, shear or flatten.
    pub world_from_object: Affine3A,
}

/// A metallic-roughness surface.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name; shot files refer to it.
    pub name: String,
    /// Linear RGB and opacity.
    pub base_color: Vec4,
    /// sRGB-encoded color and linear alpha, multiplied onto `base_color`.
    pub base_color_texture: Option<TextureSlot>,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Perceptual roughness, 0…1.
    pub roughness: f32,
    /// Roughness in G, metalness in B.
    pub metallic_roughness_texture: Option<TextureSlot>,
    /// Tangent-space normals.
    pub normal_texture: Option<TextureSlot>,
    /// Multiplies x and y of the decoded normal.
    pub normal_scale: f32,
    /// Emitted radiance, W·m⁻²·sr⁻¹ (factor × strength).
    pub emission: Vec3,
    /// sRGB-encoded texture multiplied onto `emission`.
    pub emission_texture: Option<TextureSlot>,
    /// What opacity means.
    pub alpha_mode: AlphaMode,
    /// Emits on both sides. Every surface blocks and reflects on both sides in any case.
    pub double_sided: bool,
    /// Shown as its base color whatever the light; neither lit nor a light.
    pub unlit: bool,
    /// Share of light let through, 0…1 (KHR_materials_transmission); kept for later methods.
    pub transmission: f32,
    /// Index of refraction (KHR_materials_ior).
    pub ior: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emission: Vec3::ZERO,
            emission_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            transmission: 0.0,
            ior: 1.5,
        }
    }
}

impl Material {
    /// A Lambertian surface of one color, metallic 0.
    pub fn lambertian(name: &str, albedo: Vec3) -> Self {
        let base_color = albedo.extend(1.0);
        Self { name: name.to_owned(), base_color, metallic: 0.0, ..Self::default() }
    }
}

/// How opacity is used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Opacity is ignored.
    Opaque,
    /// Present where opacity ≥ the cutoff, absent elsewhere.
    Mask(f32),
    /// Opacity is the probability of meeting the surface (coverage).
    Blend,
}

/// One use of an image by a material.
#[derive(Clone, Copy, Debug)]
pub struct TextureSlot {
    /// Index into [`Scene::images`].
    pub image: u32,
    /// Index into [`Mesh::uvs`].
    pub uv_set: u8,
    /// KHR_texture_transform: uv' = offset + R(rotation)·(scale ∘ uv), as a 2×3 affine map.
    pub transform: glam::Affine2,
    /// Wrapping along u and v.
    pub wrap: [Wrap; 2],
    /// Bilinear if true, else nearest.
    pub linear_filter: bool,
}

/// Behavior outside 0…1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Tiles.
    Repeat,
    /// Tiles, every other one flipped.
    Mirror,
    /// Edge texels continue.
    Clamp,
}

/// An 8-bit RGBA image, row-major from the top, encoding as in the file (color: sRGB).
#[derive(Clone)]
pub struct TextureImage {
    /// Name for messages.
    pub name: String,
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
    /// `[height · width]` RGBA.
    pub texels: Vec<[u8; 4]>,
}

impl std::fmt::Debug for TextureImage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "TextureImage({} {}x{})", self.name, self.width, self.height)
    }
}

/// A light without a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Parallel light from infinity.
    Sun {
        /// Unit, the way the light travels.
        direction: Vec3,
        /// On a surface facing the sun, W·m⁻².
        irradiance: Vec3,
    },
    /// Equal in all directions.
    Point {
        /// World position.
        position: Vec3,
        /// W·sr⁻¹.
        intensity: Vec3,
    },
    /// A cone with a smooth edge: intensity · clamp((cosθ − cos_outer)/(cos_inner − cos_outer))².
    Spot {
        /// World position.
        position: Vec3,
        /// Unit axis, the way the light travels.
        direction: Vec3,
        /// On the axis, W·sr⁻¹.
        intensity: Vec3,
        /// Cosine of the half angle where light ends.
        cos_outer: f32,
        /// Cosine of the half angle where fading begins; above `cos_outer`.
        cos_inner: f32,
    },
}

/// Radiance from infinity.
#[derive(Clone, Debug)]
pub enum Sky {
    /// The same from every direction, W·m⁻²·sr⁻¹.
    Constant(Vec3),
    /// An equirectangular map.
    Map(SkyMap),
}

/// Equirectangular radiance, row 0 at +Y; column 0 looks toward −X, the middle toward +X
/// through −Z (u grows from −X over −Z, +X, +Z back to −X), before rotation.
#[derive(Clone)]
pub struct SkyMap {
    /// Texels across.
    pub width: u32,
    /// Texels down.
    pub height: u32,
    /// Radiance `[height · width]`, W·m⁻²·sr⁻¹, scale applied.
    pub radiance: Vec<Vec3>,
    /// Turned about +Y by this, counter-clockwise seen from above, radians.
    pub rotation_rad: f32,
}

impl std::fmt::Debug for SkyMap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "SkyMap({}x{})", self.width, self.height)
    }
}

/// A camera placed in the world.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name in the file, or empty.
    pub name: String,
    /// Eye point.
    pub position: Vec3,
    /// Unit viewing direction.
    pub forward: Vec3,
    /// Unit, orthogonal to `forward`, up in the picture.
    pub up: Vec3,
    /// Lens model.
    pub projection: Projection,
    /// Picture size the author wanted, pixels, if stated.
    pub size_px: Option<[u32; 2]>,
}

/// Lens model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole with this full vertical angle, radians.
    Perspective {
        /// Full vertical angle, radians.
        vfov_rad: f32,
    },
    /// Parallel rays; half the picture's height in metres.
    Orthographic {
        /// Half height, metres.
        half_height: f32,
    },
}

impl Camera {
    /// A perspective camera from the usual three vectors.
    ///
    /// Returns `None` where position, target and up do not span a frame (equal points, parallel
    /// up, not finite).
    pub fn look_at(position: Vec3, target: Vec3, up: Vec3, vfov_rad: f32) -> Option<Self> {
        let forward = (target - position).try_normalize()?;
        let right = forward.cross(up.try_normalize()?).try_normalize()?;
        if !(position.is_finite() && right.is_finite()) || right.length_squared() < 0.5 {
            return None;
        }
        Some(Self {
            name: String::new(),
            position,
            forward,
            up: right.cross(forward),
            projection: Projection::Perspective { vfov_rad },
            size_px: None,
        })
    }
}

impl Scene {
    /// Smallest and largest coordinates of what is placed, metres; `None` without triangles.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        let mut bounds: Option<[Vec3; 2]> = None;
        for instance in &self.instances {
            let mesh = self.meshes.get(instance.mesh as usize)?;
            for &vertex in mesh.triangles.iter().flatten() {
                let p = mesh.positions.get(vertex as usize)?;
                let p = instance.world_from_object.transform_point3(*p);
                let [low, high] = bounds.unwrap_or([p, p]);
                bounds = Some([low.min(p), high.max(p)]);
            }
        }
        bounds
    }

    /// Triangles over all instances, as the renderer meets them.
    pub fn triangle_count(&self) -> u64 {
        self.instances.iter().map(|i| self.meshes[i.mesh as usize].triangles.len() as u64).sum()
    }
}

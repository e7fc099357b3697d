//! The scene on the graphics device: group 1 of every kernel that traces rays.
//!
//! In: [`World`], [`SourceLists`] · Out: [`GpuWorld`]
//! Limits: each of nodes, triangles and geometry fits one binding; textures of at most the device's
//! largest.

mod pages;
mod sky;
mod textures;

pub use sky::{SkyTexels, SourceLists};

mod binary;
mod hardware;

pub use binary::BinaryWorld;

use super::{EDGE_MARGIN, World};
use crate::bvh::gpu::{BinaryNode, GpuTree, NODE_WORDS};
use crate::error::Error;
use crate::gpu::{Buf, Constant, Feature, Gpu, SceneGroup, SceneTraits, Value, kernel, record};
use glam::{Affine3A, Mat3, Vec3};
use hardware::HardwareTree;
use manylight_scene::{AlphaMode, Instance, Material, Mesh, Scene, TextureSlot, Wrap};
use sky::SkyTexture;
use textures::{Limits, Place, Plan, Textures, refused};

const INSTANCE_WORDS: usize = 23;
const MESH_WORDS: usize = 8;
const MATERIAL_WORDS: usize = 14;
const SLOT_WORDS: usize = 15;
const PLACEMENT_WORDS: usize = 15;
/// Stands for a list or slot that is not there.
const NONE: u32 = u32::MAX;
/// Values of a slot's wrap and of a material's alpha mode.
const WRAP_REPEAT: u32 = 0;
const WRAP_MIRROR: u32 = 1;
const WRAP_CLAMP: u32 = 2;
/// Relative difference of distances below which triangles are looked at again, since the hardware
/// may round them otherwise.
const TIE_SLACK: f32 = 1e-5;
const ALPHA_OPAQUE: u32 = 0;
const ALPHA_MASK: u32 = 1;
const ALPHA_BLEND: u32 = 2;
/// Name of the list of sources.
const SOURCES: &str = "light sources";

/// Constants of `scene.wgsl`, `texture.wgsl`, `alpha.wgsl` and `walk.wgsl`.
pub const CONSTANTS: &[Constant] = &[
    Constant { name: "INSTANCE_WORDS", value: Value::U32(INSTANCE_WORDS as u32) },
    Constant { name: "MESH_WORDS", value: Value::U32(MESH_WORDS as u32) },
    Constant { name: "MATERIAL_WORDS", value: Value::U32(MATERIAL_WORDS as u32) },
    Constant { name: "SLOT_WORDS", value: Value::U32(SLOT_WORDS as u32) },
    Constant { name: "PLACEMENT_WORDS", value: Value::U32(PLACEMENT_WORDS as u32) },
    Constant { name: "WRAP_REPEAT", value: Value::U32(WRAP_REPEAT) },
    Constant { name: "WRAP_MIRROR", value: Value::U32(WRAP_MIRROR) },
    Constant { name: "ALPHA_OPAQUE", value: Value::U32(ALPHA_OPAQUE) },
    Constant { name: "ALPHA_MASK", value: Value::U32(ALPHA_MASK) },
    Constant { name: "EDGE_MARGIN", value: Value::F32(EDGE_MARGIN) },
    Constant { name: "TIE_SLACK", value: Value::F32(TIE_SLACK) },
];

record! {
    /// The uniform of group 1; words are those of the geometry.
    pub struct SceneInfo {
        /// Least corner of all triangles.
        pub bounds_low: [f32; 3],
        /// Length of the bounds' diagonal, m.
        pub diagonal: f32,
        /// Greatest corner of all triangles.
        pub bounds_high: [f32; 3],
        /// First word of the instances.
        pub instances: u32,
        /// First word of the meshes.
        pub meshes: u32,
        /// First word of the materials.
        pub materials: u32,
        /// First word of the texture slots.
        pub slots: u32,
        /// First word of the placements.
        pub placements: u32,
        /// Instances of shared meshes.
        pub placement_count: u32,
        /// Root of the hierarchy over their boxes.
        pub placement_root: u32,
        /// First word of that hierarchy's items.
        pub placement_items: u32,
        /// Triangles of instances that are not shared.
        pub flat_count: u32,
    }
}

record! {
    /// How to cast a list of rays.
    pub struct CastParams {
        /// Rays.
        pub count: u32,
        /// 1 where any hit will do, 0 for the nearest.
        pub any: u32,
    }
}

record! {
    /// What one of them met.
    pub struct HitRecord {
        /// Distance in units of the ray's direction.
        pub t: f32,
        /// Barycentric of the second corner.
        pub u: f32,
        /// Barycentric of the third corner.
        pub v: f32,
        /// Index into the scene's instances; `u32::MAX` where the ray met nothing.
        pub instance: u32,
        /// Index into the mesh's triangles.
        pub triangle: u32,
    }
}

kernel! {
    /// A list of rays against the scene: origin, t_max, direction and a number that is not used.
    pub struct Cast = "world/cast", [64, 1, 1], scene, [CONSTANTS, crate::bvh::gpu::CONSTANTS];
    uniform params: CastParams, read rays: [f32; 8], write hits: HitRecord
}

kernel! {
    /// Which of a list of rays are stopped: origin, t_max, direction and a number that is not used.
    pub struct CastBinary = "world/cast_binary", [64, 1, 1], scene,
        [CONSTANTS, crate::bvh::gpu::CONSTANTS];
    uniform params: CastParams, read rays: [f32; 8], read nodes: BinaryNode,
    read triangles: [f32; 12], write stopped: u32
}

/// Every kernel of this room.
#[cfg(test)]
pub(crate) const KERNELS: &[&crate::gpu::KernelInfo] = &[&Cast::INFO, &CastBinary::INFO];

/// The scene on the device.
#[derive(Debug)]
pub struct GpuWorld {
    group: SceneGroup,
    lists: Lists,
}

/// What the group binds.
#[derive(Debug)]
struct Lists {
    info: Buf<SceneInfo>,
    nodes: Buf<[u32; NODE_WORDS]>,
    triangles: Buf<[f32; 12]>,
    geometry: Buf<u32>,
    sources: Buf<u32>,
    textures: Textures,
    sky: SkyTexture,
    /// Where the hardware follows rays.
    tree: Option<HardwareTree>,
}

/// Everything that is copied to the device.
#[derive(Default)]
struct Packed {
    info: SceneInfo,
    nodes: Vec<[u32; NODE_WORDS]>,
    triangles: Vec<[f32; 12]>,
    geometry: Vec<u32>,
}

impl GpuWorld {
    /// Copies a world to the device; `sources` are what `emitter` packs.
    ///
    /// Errors: a list that the device cannot hold in one binding, textures beyond its limits
    /// Cost:   builds a hierarchy of its own, O(n log n)
    pub fn new(gpu: &Gpu, world: &World, sources: &SourceLists) -> Result<Self, Error> {
        let plan = Plan::new(&world.scene, Limits::from(gpu)).map_err(|e| refused(gpu, &e))?;
        let mut packed = Packed::default();
        packed.add_tables(world, &plan.places);
        let tree = if gpu.features().has(Feature::RayQueries) {
            let parts = packed.add_parts(world);
            Some(HardwareTree::build(gpu, &parts)?)
        } else {
            packed.add_hierarchies(world);
            None
        };
        // The hardware follows rays through one tree in any case.
        let tree_is_one = tree.is_some();
        let lists = Lists {
            info: gpu.upload("scene", &[packed.info])?,
            nodes: gpu.upload("nodes of the hierarchy", &packed.nodes)?,
            triangles: gpu.upload("triangles", &packed.triangles)?,
            geometry: gpu.upload("geometry", &packed.geometry)?,
            sources: gpu.upload(SOURCES, &sources.words)?,
            textures: Textures::upload(gpu, &world.scene.images, &plan),
            sky: SkyTexture::upload(gpu, &sources.sky)?,
            tree,
        };
        let traits = SceneTraits {
            placements: !world.placements.is_empty() || tree_is_one,
            holes: world.any_holes(),
        };
        Ok(Self { group: SceneGroup { group: lists.group(gpu), traits }, lists })
    }

    /// Takes other sources. What was recorded before keeps those that it was recorded with.
    ///
    /// Errors: more than the device can hold in one binding; nothing has changed then
    pub fn set_sources(&mut self, gpu: &Gpu, sources: &SourceLists) -> Result<(), Error> {
        let sky = SkyTexture::upload(gpu, &sources.sky)?;
        self.lists.sources = gpu.upload(SOURCES, &sources.words)?;
        self.lists.sky = sky;
        self.group.group = self.lists.group(gpu);
        Ok(())
    }

    /// Group 1 of kernels that trace rays.
    pub fn group(&self) -> &SceneGroup {
        &self.group
    }
}

impl Lists {
    fn group(&self, gpu: &Gpu) -> wgpu::BindGroup {
        let views = self.textures.views();
        let mut bindings = vec![
            (0, self.info.raw().as_entire_binding()),
            (1, self.nodes.raw().as_entire_binding()),
            (2, self.triangles.raw().as_entire_binding()),
            (3, self.geometry.raw().as_entire_binding()),
            (4, self.sources.raw().as_entire_binding()),
            (5, self.textures.binding(&views)),
            (7, wgpu::BindingResource::TextureView(&self.sky.view)),
        ];
        bindings.extend(self.tree.as_ref().map(|tree| (6, tree.binding())));
        let entry = |(binding, resource)| wgpu::BindGroupEntry { binding, resource };
        let entries: Vec<_> = bindings.into_iter().map(entry).collect();
        gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene"),
            layout: gpu.scene_layout(),
            entries: &entries,
        })
    }
}

/// Words of some floats.
fn bits<const N: usize>(values: [f32; N]) -> [u32; N] {
    values.map(f32::to_bits)
}

fn matrix_bits(m: Mat3) -> [u32; 9] {
    bits(m.to_cols_array())
}

impl Packed {
    /// Instances, meshes, materials and texture slots.
    fn add_tables(&mut self, world: &World, places: &[Place]) {
        let scene = &world.scene;
        self.info.bounds_low = world.bounds[0].to_array();
        self.info.bounds_high = world.bounds[1].to_array();
        self.info.diagonal = world.diagonal();
        self.info.instances = self.geometry.len() as u32;
        for (instance, normals) in scene.instances.iter().zip(&world.normal_matrices) {
            let linear = instance.world_from_object.matrix3;
            self.geometry.extend(matrix_bits(linear.into()));
            self.geometry.extend(bits(instance.world_from_object.translation.to_array()));
            self.geometry.extend(matrix_bits((*normals).into()));
            let side = if linear.determinant() < 0.0 { -1.0f32 } else { 1.0 };
            self.geometry.extend([instance.mesh, side.to_bits()]);
        }
        let mut slots = Vec::new();
        self.info.materials = self.geometry.len() as u32;
        for material in &scene.materials {
            self.add_material(material, places, &mut slots);
        }
        self.info.slots = self.geometry.len() as u32;
        self.geometry.extend(slots);
        let needs = needs_of_meshes(scene);
        let meshes = scene.meshes.iter().zip(needs);
        let lists: Vec<_> = meshes.map(|(mesh, needs)| self.add_lists(mesh, needs)).collect();
        self.info.meshes = self.geometry.len() as u32;
        self.geometry.extend(lists.into_iter().flatten());
    }

    fn add_material(&mut self, material: &Material, places: &[Place], slots: &mut Vec<u32>) {
        let (mode, cutoff) = match material.alpha_mode {
            AlphaMode::Opaque => (ALPHA_OPAQUE, 0.0),
            AlphaMode::Mask(cutoff) => (ALPHA_MASK, cutoff),
            AlphaMode::Blend => (ALPHA_BLEND, 0.0),
        };
        let mut slot = |slot: &Option<TextureSlot>| match slot {
            None => NONE,
            Some(slot) => {
                slots.extend(slot_words(slot, &places[slot.image as usize]));
                (slots.len() / SLOT_WORDS - 1) as u32
            }
        };
        let textures = [
            slot(&material.base_color_texture),
            slot(&material.emission_texture),
            slot(&material.normal_texture),
        ];
        self.geometry.extend(bits(material.base_color.to_array()));
        self.geometry.extend(bits(material.emission.to_array()));
        self.geometry.extend([mode, cutoff.to_bits(), material.normal_scale.to_bits()]);
        self.geometry.push(u32::from(material.unlit) | u32::from(material.double_sided) << 1);
        self.geometry.extend(textures);
    }

    /// Adds the lists of a mesh; the words that say where they begin.
    fn add_lists(&mut self, mesh: &Mesh, needs: Needs) -> [u32; MESH_WORDS] {
        fn list(words: &mut Vec<u32>, values: &[f32]) -> u32 {
            let first = words.len() as u32;
            words.extend_from_slice(bytemuck::cast_slice(values));
            if values.is_empty() { NONE } else { first }
        }
        if !needs.any {
            return [mesh.material, NONE, NONE, NONE, NONE, NONE, NONE, NONE];
        }
        let triangles = self.geometry.len() as u32;
        self.geometry.extend(mesh.triangles.iter().flatten());
        let geometry = &mut self.geometry;
        let flat3 = |v: &[Vec3]| v.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
        let flat4 = |v: &[glam::Vec4]| v.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
        let flat2 = |v: &[glam::Vec2]| v.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
        [
            mesh.material,
            triangles,
            list(geometry, &flat3(&mesh.positions)),
            list(geometry, &flat3(&mesh.normals)),
            list(geometry, &if needs.tangents { flat4(&mesh.tangents) } else { Vec::new() }),
            list(geometry, &if needs.uvs[0] { flat2(&mesh.uvs[0]) } else { Vec::new() }),
            list(geometry, &if needs.uvs[1] { flat2(&mesh.uvs[1]) } else { Vec::new() }),
            list(geometry, &flat4(&mesh.colors)),
        ]
    }

    /// The hierarchies: of copied triangles, of each shared mesh, of the boxes of its instances.
    fn add_hierarchies(&mut self, world: &World) {
        let corners = world.flat_corners();
        self.info.flat_count = corners.len() as u32;
        self.add_tree(&corners);
        let shared = (0..world.shared.len()).map(|i| self.add_tree(&world.shared_corners(i)));
        let roots: Vec<[u32; 2]> = shared.collect();
        self.info.placement_count = world.placements.len() as u32;
        self.info.placements = self.geometry.len() as u32;
        for placement in &world.placements {
            let words = roots[placement.shared as usize];
            self.add_placement(&placement.object_from_world, placement.instance, words);
        }
        let boxes: Vec<_> = world.placements.iter().map(|p| p.bounds).collect();
        let tree = GpuTree::build(&boxes);
        self.info.placement_root = self.nodes.len() as u32;
        self.nodes.extend(tree.nodes);
        self.info.placement_items = self.geometry.len() as u32;
        self.geometry.extend(tree.order);
    }

    fn add_placement(&mut self, object_from_world: &Affine3A, instance: u32, words: [u32; 2]) {
        self.geometry.extend(matrix_bits(object_from_world.matrix3.into()));
        self.geometry.extend(bits(object_from_world.translation.to_array()));
        self.geometry.push(instance);
        self.geometry.extend(words);
    }

    /// Adds a hierarchy of triangles; its root and its first triangle.
    fn add_tree(&mut self, triangles: &[Placed]) -> [u32; 2] {
        let boxes: Vec<[Vec3; 2]> =
            triangles.iter().map(|t| super::bounds_of(t.corners.into_iter())).collect();
        let tree = GpuTree::build(&boxes);
        let first = [self.nodes.len() as u32, self.triangles.len() as u32];
        self.nodes.extend(tree.nodes);
        self.triangles.extend(tree.order.iter().map(|&i| triangles[i as usize].words(i)));
        first
    }
}

/// A triangle of a hierarchy.
#[derive(Clone, Copy, Debug)]
struct Placed {
    corners: [Vec3; 3],
    /// `NONE` in meshes that are shared.
    instance: u32,
    /// Position in its mesh.
    triangle: u32,
    opaque: bool,
}

impl Placed {
    /// As the shaders know it, at a place in the builder's list.
    fn words(&self, place: u32) -> [f32; 12] {
        let [a, b, c] = self.corners;
        let ids = [self.instance, self.triangle, place << 1 | u32::from(self.opaque)];
        let mut words = [0.0; 12];
        for ((row, v), id) in words.chunks_exact_mut(4).zip([a, b - a, c - a]).zip(ids) {
            row.copy_from_slice(&v.extend(f32::from_bits(id)).to_array());
        }
        words
    }
}

impl World {
    /// Whether some rays pass some of its surfaces.
    fn any_holes(&self) -> bool {
        let material = |instance: &Instance| self.scene.meshes[instance.mesh as usize].material;
        self.scene.instances.iter().any(|i| self.has_holes[material(i) as usize])
    }

    /// Triangles that are copied, in the world.
    fn flat_corners(&self) -> Vec<Placed> {
        let placed = |&[instance, triangle]: &[u32; 2]| Placed {
            corners: self.corners(instance, triangle),
            instance,
            triangle,
            opaque: !self.has_holes[self.mesh_of(instance).material as usize],
        };
        self.flat_triangles.iter().map(placed).collect()
    }

    /// Triangles of a mesh that is shared, in its space.
    fn shared_corners(&self, shared: usize) -> Vec<Placed> {
        let mesh = &self.scene.meshes[self.shared[shared].mesh];
        let placed = |&triangle: &u32| Placed {
            corners: mesh.triangles[triangle as usize].map(|v| mesh.positions[v as usize]),
            instance: NONE,
            triangle,
            opaque: !self.has_holes[mesh.material as usize],
        };
        self.shared[shared].triangles.iter().map(placed).collect()
    }
}

/// What kernels read of a mesh.
#[derive(Clone, Copy, Debug, Default)]
struct Needs {
    /// Anything at all: it is in the scene.
    any: bool,
    /// Its material has a texture of normals.
    tangents: bool,
    /// Its material has textures with these coordinates.
    uvs: [bool; 2],
}

fn needs_of_meshes(scene: &Scene) -> Vec<Needs> {
    let mut needs = vec![Needs::default(); scene.meshes.len()];
    for instance in &scene.instances {
        let material = &scene.materials[scene.meshes[instance.mesh as usize].material as usize];
        let uses = |set| slots_of(material).iter().any(|s| usize::from(s.uv_set.min(1)) == set);
        let tangents = material.normal_texture.is_some();
        needs[instance.mesh as usize] = Needs { any: true, tangents, uvs: [uses(0), uses(1)] };
    }
    needs
}

/// The textures of a material that kernels read: color, emission, normals.
fn slots_of(material: &Material) -> Vec<&TextureSlot> {
    let Material { base_color_texture, emission_texture, normal_texture, .. } = material;
    [base_color_texture, emission_texture, normal_texture].into_iter().flatten().collect()
}

fn slot_words(slot: &TextureSlot, place: &Place) -> [u32; SLOT_WORDS] {
    let wrap = slot.wrap.map(|wrap| match wrap {
        Wrap::Repeat => WRAP_REPEAT,
        Wrap::Mirror => WRAP_MIRROR,
        Wrap::Clamp => WRAP_CLAMP,
    });
    let map = bits(slot.transform.to_cols_array());
    let [width, height] = place.size;
    let filter = u32::from(slot.linear_filter);
    let set = u32::from(slot.uv_set);
    [
        place.page, place.x, place.y, width, height, wrap[0], wrap[1], filter, set, map[0], map[1],
        map[2], map[3], map[4], map[5],
    ]
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod texture_tests;

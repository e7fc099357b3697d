//! The scene as the renderer holds it: triangles in the world, what they are made of, and how
//! rays meet them.
//!
//! In: [`Scene`] · Out: [`World`] · Limits: instances are copied into one hierarchy unless the
//! copies would hold more than [`COPY_LIMIT`] triangles of one mesh or [`COPIES_LIMIT`] in all;
//! then their triangles are kept once, below a hierarchy over the instances' boxes.

mod alpha;
#[cfg(feature = "gpu")]
pub mod gpu;
mod texture;

pub use texture::{sample_rgba, sample_srgb};

use crate::bvh::{BoxTree, Bvh, Ray, Triangle};
use crate::error::Error;
use glam::{Affine3A, Mat3A, Vec3};
use manylight_scene::Scene;

/// Most triangles that the copies of one instanced mesh may add to the shared hierarchy.
pub const COPY_LIMIT: u64 = 4_000_000;
/// Most triangles that the copies of all instanced meshes may add to it.
pub const COPIES_LIMIT: u64 = 8_000_000;

/// Geometry, materials and ray queries of one scene.
#[derive(Debug)]
pub struct World {
    /// The scene it was built from.
    pub scene: Scene,
    /// Inverse transposes of the instances' linear parts, for normals.
    normal_matrices: Vec<Mat3A>,
    /// Per material: may a ray pass some of it?
    has_holes: Vec<bool>,
    /// Triangles of all instances that are not `Shared`.
    flat: Bvh,
    /// Builder position → instance and triangle.
    flat_triangles: Vec<[u32; 2]>,
    /// Meshes that are instanced too often to be copied, in object space.
    shared: Vec<Shared>,
    /// Their instances.
    placements: Vec<Placement>,
    /// The boxes of `placements`.
    placement_tree: BoxTree,
    /// Bounds of all triangles.
    pub bounds: [Vec3; 2],
}

/// A mesh that its instances share.
#[derive(Debug)]
struct Shared {
    /// Index into the scene's meshes.
    #[cfg(feature = "gpu")]
    mesh: usize,
    bvh: Bvh,
    /// Builder position → triangle of the mesh.
    triangles: Vec<u32>,
}

/// An instance of a shared mesh.
#[derive(Debug)]
struct Placement {
    instance: u32,
    /// Index into `World::shared`.
    shared: u32,
    object_from_world: Affine3A,
    /// Its box in the world.
    bounds: [Vec3; 2],
}

/// Where a ray met the scene.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Barycentrics of the second and third corner.
    pub barycentrics: [f32; 2],
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
}

/// Least share of a corner in a point of a triangle where rays start or end.
pub(crate) const EDGE_MARGIN: f32 = 1e-5;

impl Hit {
    /// The barycentrics of the hit, a little inside the triangle: on its very edge rounding may put
    /// the point behind the other surface of a corner, where all is dark.
    #[inline]
    pub fn inside(&self) -> [f32; 2] {
        let [u, v] = self.barycentrics;
        let w = 1.0 - u - v;
        if u.min(v).min(w) >= EDGE_MARGIN {
            return [u, v];
        }
        let [u, v, w] = [u, v, w].map(|share| share.max(EDGE_MARGIN));
        [u / (u + v + w), v / (u + v + w)]
    }
}

impl World {
    /// Flattens a scene and builds its hierarchies.
    ///
    /// Errors: a scene without a triangle of positive area
    /// Cost:   O(n log n), dominated by the hierarchy
    pub fn new(scene: Scene) -> Result<Self, Error> {
        Self::sharing(scene, is_shared)
    }

    /// `new` with another rule than [`is_shared`] for which meshes share a hierarchy.
    fn sharing(scene: Scene, is_shared: fn(u64, u64, u64) -> bool) -> Result<Self, Error> {
        let mut placements = vec![Vec::new(); scene.meshes.len()];
        for (index, instance) in scene.instances.iter().enumerate() {
            placements[instance.mesh as usize].push(index as u32);
        }
        let has_holes: Vec<bool> = scene.materials.iter().map(alpha::has_holes).collect();
        let mut world = Self {
            normal_matrices: scene
                .instances
                .iter()
                .map(|i| normal_matrix(&i.world_from_object))
                .collect(),
            has_holes,
            flat: Bvh::build(&[]),
            flat_triangles: Vec::new(),
            shared: Vec::new(),
            placements: Vec::new(),
            placement_tree: BoxTree::build(&[]),
            bounds: [Vec3::INFINITY, Vec3::NEG_INFINITY],
            scene,
        };
        let mut flat = Vec::new();
        let mut copied = 0;
        for (mesh, instances) in placements.iter().enumerate() {
            let triangles = world.scene.meshes[mesh].triangles.len() as u64;
            if is_shared(triangles, instances.len() as u64, copied) {
                world.add_shared(mesh, instances);
            } else {
                copied += triangles * (instances.len() as u64).saturating_sub(1);
                instances.iter().for_each(|&i| world.add_flat(i, &mut flat));
            }
        }
        world.flat = Bvh::build(&flat);
        let boxes: Vec<_> = world.placements.iter().map(|p| p.bounds).collect();
        world.placement_tree = BoxTree::build(&boxes);
        if !world.bounds[0].is_finite() {
            return Err(Error::Scene {
                scene: world.scene.name.clone(),
                problem: "has no triangle that is large enough, with edges above about 1e-11 m; \
                          scale the scene up"
                    .to_owned(),
            });
        }
        Ok(world)
    }

    fn add_flat(&mut self, instance: u32, flat: &mut Vec<Triangle>) {
        let opaque = !self.has_holes[self.mesh_of(instance).material as usize];
        for triangle in 0..self.mesh_of(instance).triangles.len() as u32 {
            let corners = self.corners(instance, triangle);
            if self.grow_bounds(&corners) {
                flat.push(Triangle { corners, opaque });
                self.flat_triangles.push([instance, triangle]);
            }
        }
    }

    /// Adds a mesh once and its instances with their boxes.
    fn add_shared(&mut self, mesh: usize, instances: &[u32]) {
        let source = &self.scene.meshes[mesh];
        let opaque = !self.has_holes[source.material as usize];
        let (mut build, mut triangles) = (Vec::new(), Vec::new());
        for (triangle, vertices) in source.triangles.iter().enumerate() {
            let corners = vertices.map(|v| source.positions[v as usize]);
            if has_area(&corners) {
                build.push(Triangle { corners, opaque });
                triangles.push(triangle as u32);
            }
        }
        let bounds = bounds_of(build.iter().flat_map(|t| t.corners));
        let shared = self.shared.len() as u32;
        self.shared.push(Shared {
            #[cfg(feature = "gpu")]
            mesh,
            bvh: Bvh::build(&build),
            triangles,
        });
        for &instance in instances {
            let world_from_object = self.scene.instances[instance as usize].world_from_object;
            let bounds = placed_bounds(&world_from_object, bounds);
            // A flattened instance has no inverse and no area worth meeting from most sides.
            if world_from_object.matrix3.determinant().abs() < 1e-30 || !bounds[0].is_finite() {
                continue;
            }
            self.bounds = [self.bounds[0].min(bounds[0]), self.bounds[1].max(bounds[1])];
            let object_from_world = world_from_object.inverse();
            self.placements.push(Placement { instance, shared, object_from_world, bounds });
        }
    }

    /// Widens the bounds by a triangle; false where it has no area.
    fn grow_bounds(&mut self, corners: &[Vec3; 3]) -> bool {
        if !has_area(corners) {
            return false;
        }
        let [low, high] = bounds_of(corners.iter().copied());
        self.bounds = [self.bounds[0].min(low), self.bounds[1].max(high)];
        true
    }

    /// Corners of a triangle in the world.
    #[inline]
    pub fn corners(&self, instance: u32, triangle: u32) -> [Vec3; 3] {
        let placed = &self.scene.instances[instance as usize];
        let mesh = &self.scene.meshes[placed.mesh as usize];
        mesh.triangles[triangle as usize]
            .map(|v| placed.world_from_object.transform_point3(mesh.positions[v as usize]))
    }

    /// The mesh an instance places.
    #[inline]
    pub fn mesh_of(&self, instance: u32) -> &manylight_scene::Mesh {
        &self.scene.meshes[self.scene.instances[instance as usize].mesh as usize]
    }

    /// The material of an instance.
    #[inline]
    pub fn material_of(&self, instance: u32) -> &manylight_scene::Material {
        &self.scene.materials[self.mesh_of(instance).material as usize]
    }

    /// Turns an object-space normal into the world, unit length where it has one.
    #[inline]
    pub fn world_normal(&self, instance: u32, normal: Vec3) -> Vec3 {
        (self.normal_matrices[instance as usize] * normal).normalize_or_zero()
    }

    /// Length of the bounds' diagonal.
    pub fn diagonal(&self) -> f32 {
        (self.bounds[1] - self.bounds[0]).length()
    }

    /// How far a ray must start above a surface at `p` to leave it behind.
    ///
    /// A few roundings of a coordinate of p, and of the scene's size for instances.
    #[inline]
    pub fn ray_offset(&self, p: Vec3) -> f32 {
        p.abs().max_element() * 8e-6 + self.diagonal() * 2.5e-7
    }

    /// The nearest surface along a ray. Texels that are cut out are passed.
    #[inline]
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        let accept =
            |instance, triangle, barycentrics| self.stops(ray, instance, triangle, barycentrics);
        let flat = self.flat.closest(ray, |h| {
            let [instance, triangle] = self.flat_triangles[h.triangle as usize];
            accept(instance, triangle, h.barycentrics)
        });
        let mut best = flat.map(|h| {
            let [instance, triangle] = self.flat_triangles[h.triangle as usize];
            Hit { t: h.t, barycentrics: h.barycentrics, instance, triangle }
        });
        if self.placements.is_empty() {
            return best;
        }
        let near = Ray { t_max: best.map_or(ray.t_max, |b| b.t), ..*ray };
        self.placement_tree.visit_near(&near, |index, t_max| {
            let Placement { instance, shared, .. } = self.placements[index as usize];
            let local = self.placements[index as usize].local_ray(ray, t_max);
            let Shared { bvh, triangles, .. } = &self.shared[shared as usize];
            let hit = bvh.closest(&local, |h| {
                accept(instance, triangles[h.triangle as usize], h.barycentrics)
            });
            let Some(h) = hit else { return t_max };
            let (barycentrics, triangle) = (h.barycentrics, triangles[h.triangle as usize]);
            best = Some(Hit { t: h.t, barycentrics, instance, triangle });
            h.t
        });
        best
    }

    /// Whether anything stops a ray.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.flat.occluded(ray, |h| {
            let [instance, triangle] = self.flat_triangles[h.triangle as usize];
            self.stops(ray, instance, triangle, h.barycentrics)
        }) || self.is_occluded_by_placements(ray)
    }

    fn is_occluded_by_placements(&self, ray: &Ray) -> bool {
        !self.placements.is_empty()
            && self.placement_tree.visit_any(ray, |index| {
                let placement = &self.placements[index as usize];
                let local = placement.local_ray(ray, ray.t_max);
                let Shared { bvh, triangles, .. } = &self.shared[placement.shared as usize];
                bvh.occluded(&local, |h| {
                    let triangle = triangles[h.triangle as usize];
                    self.stops(ray, placement.instance, triangle, h.barycentrics)
                })
            })
    }
}

impl Placement {
    /// The ray in object space, with the same t.
    fn local_ray(&self, ray: &Ray, t_max: f32) -> Ray {
        Ray {
            origin: self.object_from_world.transform_point3(ray.origin),
            direction: self.object_from_world.transform_vector3(ray.direction),
            t_max,
        }
    }
}

/// Whether a triangle has a finite area of its own.
fn has_area([a, b, c]: &[Vec3; 3]) -> bool {
    let area = (b - a).cross(c - a);
    area.is_finite() && area.length_squared() > 0.0
}

/// The box in the world around a box in object space.
fn placed_bounds(world_from_object: &Affine3A, [low, high]: [Vec3; 2]) -> [Vec3; 2] {
    let corner = |i: u32| {
        let pick = |axis: u32, a: f32, b: f32| if i >> axis & 1 == 0 { a } else { b };
        Vec3::new(pick(0, low.x, high.x), pick(1, low.y, high.y), pick(2, low.z, high.z))
    };
    let [low, high] = bounds_of((0..8).map(|i| world_from_object.transform_point3(corner(i))));
    // What a ray meets in object space may lie outside by the roundings of both spaces.
    let slack = low.abs().max(high.abs()) * 1e-6;
    [low - slack, high + slack]
}

/// Whether the instances of a mesh share one hierarchy, after others `copied` their triangles.
fn is_shared(triangles: u64, instances: u64, copied: u64) -> bool {
    let all = triangles * instances;
    instances > 1 && (all > COPY_LIMIT || copied + all - triangles > COPIES_LIMIT)
}

fn bounds_of(points: impl Iterator<Item = Vec3>) -> [Vec3; 2] {
    points.fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)])
}

/// The inverse transpose up to a positive scale, by cofactors: defined for singular maps too.
///
/// A mirroring keeps the outer side of a mesh outside.
fn normal_matrix(world_from_object: &Affine3A) -> Mat3A {
    let m = world_from_object.matrix3;
    let side = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    Mat3A::from_cols(
        m.y_axis.cross(m.z_axis) * side,
        m.z_axis.cross(m.x_axis) * side,
        m.x_axis.cross(m.y_axis) * side,
    )
}

#[cfg(test)]
mod tests;

//! The scene as the renderer holds it: triangles in the world, what they are made of, and how
//! rays meet them.
//!
//! In: [`Scene`] · Out: [`World`] · Limits: instances are copied into one hierarchy unless the
//! copies would hold more than [`COPY_LIMIT`] triangles of one mesh or [`COPIES_LIMIT`] in all.

mod alpha;
mod texture;

pub use texture::{sample_rgba, sample_srgb};

use crate::bvh::{Bvh, Ray, Triangle};
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
    /// Meshes that are instanced too often to be copied.
    shared: Vec<SharedMesh>,
    /// Bounds of all triangles.
    pub bounds: [Vec3; 2],
}

/// A hierarchy in object space with the instances that place it.
#[derive(Debug)]
struct SharedMesh {
    bvh: Bvh,
    /// Builder position → triangle of the mesh.
    triangles: Vec<u32>,
    instances: Vec<Placement>,
}

#[derive(Debug)]
struct Placement {
    instance: u32,
    object_from_world: Affine3A,
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

impl World {
    /// Flattens a scene and builds its hierarchies.
    ///
    /// Errors: a scene without a triangle of positive area
    /// Cost:   O(n log n), dominated by the hierarchy
    pub fn new(scene: Scene) -> Result<Self, Error> {
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
        if !world.bounds[0].is_finite() {
            return Err(Error::Scene {
                scene: world.scene.name.clone(),
                problem: "has no triangle to render; export its meshes as triangles".to_owned(),
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

    fn add_shared(&mut self, mesh: usize, instances: &[u32]) {
        let source = &self.scene.meshes[mesh];
        let opaque = !self.has_holes[source.material as usize];
        let corners = |t: &[u32; 3]| t.map(|v| source.positions[v as usize]);
        let build: Vec<Triangle> =
            source.triangles.iter().map(|t| Triangle { corners: corners(t), opaque }).collect();
        let triangles = (0..build.len() as u32).collect();
        let [low, high] = bounds_of(build.iter().flat_map(|t| t.corners));
        let mut placed = Vec::new();
        for &instance in instances {
            let world_from_object = self.scene.instances[instance as usize].world_from_object;
            let corner = |i: u32| {
                let pick = |axis: u32, a: f32, b: f32| if i >> axis & 1 == 0 { a } else { b };
                let p = Vec3::new(
                    pick(0, low.x, high.x),
                    pick(1, low.y, high.y),
                    pick(2, low.z, high.z),
                );
                world_from_object.transform_point3(p)
            };
            let bounds = bounds_of((0..8).map(corner));
            // A flattened instance has no inverse and no area worth meeting from most sides.
            if world_from_object.matrix3.determinant().abs() < 1e-30 || !bounds[0].is_finite() {
                continue;
            }
            self.bounds = [self.bounds[0].min(bounds[0]), self.bounds[1].max(bounds[1])];
            let object_from_world = world_from_object.inverse();
            placed.push(Placement { instance, object_from_world, bounds });
        }
        self.shared.push(SharedMesh { bvh: Bvh::build(&build), triangles, instances: placed });
    }

    /// Widens the bounds by a triangle; false where it has no area.
    fn grow_bounds(&mut self, corners: &[Vec3; 3]) -> bool {
        let area = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        if !(area.is_finite() && area.length_squared() > 0.0) {
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
        for (shared, placement) in self.placements() {
            let t_max = best.map_or(ray.t_max, |b| b.t);
            let Some(local) = placement.local_ray(ray, t_max) else { continue };
            let of = |h: u32| shared.triangles[h as usize];
            let hit = shared
                .bvh
                .closest(&local, |h| accept(placement.instance, of(h.triangle), h.barycentrics));
            best = hit.map_or(best, |h| {
                let (instance, triangle) = (placement.instance, of(h.triangle));
                Some(Hit { t: h.t, barycentrics: h.barycentrics, instance, triangle })
            });
        }
        best
    }

    /// Whether anything stops a ray.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.flat.occluded(ray, |h| {
            let [instance, triangle] = self.flat_triangles[h.triangle as usize];
            self.stops(ray, instance, triangle, h.barycentrics)
        }) || self.placements().any(|(shared, placement)| {
            placement.local_ray(ray, ray.t_max).is_some_and(|local| {
                shared.bvh.occluded(&local, |h| {
                    let triangle = shared.triangles[h.triangle as usize];
                    self.stops(ray, placement.instance, triangle, h.barycentrics)
                })
            })
        })
    }

    fn placements(&self) -> impl Iterator<Item = (&SharedMesh, &Placement)> {
        self.shared.iter().flat_map(|s| s.instances.iter().map(move |p| (s, p)))
    }
}

impl Placement {
    /// The ray in object space, with the same t; `None` where it misses the bounds.
    fn local_ray(&self, ray: &Ray, t_max: f32) -> Option<Ray> {
        let inverse = ray.direction.recip();
        let a = (self.bounds[0] - ray.origin) * inverse;
        let b = (self.bounds[1] - ray.origin) * inverse;
        let enter = a.min(b).max_element().max(0.0);
        let leave = a.max(b).min_element().min(t_max);
        (enter <= leave * 1.000_001).then(|| Ray {
            origin: self.object_from_world.transform_point3(ray.origin),
            direction: self.object_from_world.transform_vector3(ray.direction),
            t_max,
        })
    }
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

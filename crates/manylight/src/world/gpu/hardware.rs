//! The hierarchy of the hardware, where it follows rays: one tree of all copied triangles and one
//! of each shared mesh, below a tree of instances.

use super::{NONE, Packed, Placed};
use crate::error::Error;
use crate::gpu::{Gpu, HeldBytes};
use crate::world::World;
use glam::{Affine3A, Mat4};

/// Bytes of a tree that one triangle and one instance are taken for: drivers keep what they really
/// take to themselves.
const TRIANGLE_BYTES: u64 = 96;
const INSTANCE_BYTES: u64 = 192;
/// Bytes of a corner.
const VERTEX_BYTES: u64 = 12;
/// How trees are built: once, for many rays.
const FLAGS: wgpu::AccelerationStructureFlags = wgpu::AccelerationStructureFlags::PREFER_FAST_TRACE;
const UPDATES: wgpu::AccelerationStructureUpdateMode = wgpu::AccelerationStructureUpdateMode::Build;

/// A list of triangles with a tree of its own: first those that stop every ray, then those with
/// holes.
#[derive(Debug)]
pub(super) struct Part {
    corners: Vec<[[f32; 3]; 3]>,
    opaque: usize,
    /// Its place among the triangles of the scene.
    first: u32,
}

/// What the tree is built from.
#[derive(Debug)]
pub(super) struct Parts {
    parts: Vec<Part>,
    /// Part of each instance and where it is placed, as the placements of the scene.
    placed: Vec<(usize, Affine3A)>,
}

/// The tree of instances; it keeps those of their triangles.
#[derive(Debug)]
pub(super) struct HardwareTree {
    tlas: wgpu::Tlas,
    _bytes: HeldBytes,
}

impl Packed {
    /// Triangles and placements for the hardware's tree. The copied triangles, if there are any,
    /// are placed first.
    pub(super) fn add_parts(&mut self, world: &World) -> Parts {
        let mut parts = Parts { parts: Vec::new(), placed: Vec::new() };
        self.info.flat_count = world.flat_triangles.len() as u32;
        parts.parts.push(self.add_part(world.flat_corners()));
        let shared = (0..world.shared.len()).map(|i| self.add_part(world.shared_corners(i)));
        parts.parts.extend(shared);
        self.info.placements = self.geometry.len() as u32;
        if self.info.flat_count > 0 {
            self.add_placement(&Affine3A::IDENTITY, NONE, parts.parts[0].starts());
            parts.placed.push((0, Affine3A::IDENTITY));
        }
        for placement in &world.placements {
            let part = placement.shared as usize + 1;
            let starts = parts.parts[part].starts();
            self.add_placement(&placement.object_from_world, placement.instance, starts);
            let instance = &world.scene.instances[placement.instance as usize];
            parts.placed.push((part, instance.world_from_object));
        }
        self.info.placement_count = parts.placed.len() as u32;
        parts
    }

    fn add_part(&mut self, mut triangles: Vec<Placed>) -> Part {
        triangles.sort_by_key(|t| !t.opaque);
        let first = self.triangles.len() as u32;
        self.triangles.extend((0..).zip(&triangles).map(|(i, t)| t.words(i)));
        let corners = triangles.iter().map(|t| t.corners.map(|p| p.to_array())).collect();
        Part { corners, opaque: triangles.partition_point(|t| t.opaque), first }
    }
}

impl Part {
    /// Places of the lists that are not empty: first triangle, count, and whether they stop every
    /// ray.
    fn lists(&self) -> Vec<(usize, usize, bool)> {
        let holes = (self.opaque, self.corners.len() - self.opaque, false);
        [(0, self.opaque, true), holes].into_iter().filter(|list| list.1 > 0).collect()
    }

    /// Where the lists begin among the triangles of the scene.
    fn starts(&self) -> [u32; 2] {
        let lists = self.lists();
        [0, 1].map(|i| self.first + lists.get(i).map_or(0, |list| list.0 as u32))
    }

    fn sizes(&self) -> Vec<wgpu::BlasTriangleGeometrySizeDescriptor> {
        let size = |(_, count, opaque)| wgpu::BlasTriangleGeometrySizeDescriptor {
            vertex_format: wgpu::VertexFormat::Float32x3,
            vertex_count: 3 * count as u32,
            index_format: None,
            index_count: None,
            flags: match opaque {
                true => wgpu::AccelerationStructureGeometryFlags::OPAQUE,
                false => wgpu::AccelerationStructureGeometryFlags::empty(),
            },
        };
        self.lists().into_iter().map(size).collect()
    }
}

/// The tree of a part, with what it is built from.
struct PartTree {
    blas: wgpu::Blas,
    sizes: Vec<wgpu::BlasTriangleGeometrySizeDescriptor>,
    /// First corner of each list.
    starts: Vec<u32>,
    vertices: wgpu::Buffer,
}

impl PartTree {
    /// None without triangles: it has no instances either.
    fn new(gpu: &Gpu, part: &Part) -> Option<Self> {
        let sizes = part.sizes();
        if sizes.is_empty() {
            return None;
        }
        let descriptor = wgpu::CreateBlasDescriptor {
            label: Some("triangles"),
            flags: FLAGS,
            update_mode: UPDATES,
        };
        let contents: &[u8] = bytemuck::cast_slice(&part.corners);
        // Not mapped at first: where there is no memory for it that would end the program.
        let vertices = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("corners"),
            size: contents.len() as u64,
            usage: wgpu::BufferUsages::BLAS_INPUT | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        gpu.queue().write_buffer(&vertices, 0, contents);
        let descriptors = sizes.clone();
        let blas = gpu
            .device()
            .create_blas(&descriptor, wgpu::BlasGeometrySizeDescriptors::Triangles { descriptors });
        let starts = part.lists().iter().map(|list| 3 * list.0 as u32).collect();
        Some(Self { blas, sizes, starts, vertices })
    }

    fn entry(&self) -> wgpu::BlasBuildEntry<'_> {
        let list = |(size, first_vertex)| wgpu::BlasTriangleGeometry {
            size,
            vertex_buffer: &self.vertices,
            first_vertex,
            vertex_stride: VERTEX_BYTES,
            index_buffer: None,
            first_index: None,
            transform_buffer: None,
            transform_buffer_offset: None,
        };
        let lists = self.sizes.iter().zip(self.starts.iter().copied()).map(list).collect();
        let geometry = wgpu::BlasGeometries::TriangleGeometries(lists);
        wgpu::BlasBuildEntry { blas: &self.blas, geometry }
    }
}

impl HardwareTree {
    /// Builds the tree.
    ///
    /// Errors: more triangles or instances than the device allows, or than it has room for
    pub(super) fn build(gpu: &Gpu, parts: &Parts) -> Result<Self, Error> {
        let limits = gpu.limits();
        let lists = parts.parts.iter().flat_map(Part::lists);
        let most = lists.map(|(_, count, _)| count).max().unwrap_or(0);
        // The limit is compared with corners.
        if 3 * most as u64 > u64::from(limits.max_blas_primitive_count) {
            return Err(refused(gpu, &format!("{most} triangles in one list")));
        }
        let corners = parts.parts.iter().map(|part| size_of_val(&part.corners[..])).max();
        if corners.unwrap_or(0) as u64 > limits.max_buffer_size {
            return Err(refused(gpu, &format!("{} bytes of corners", corners.unwrap_or(0))));
        }
        if parts.placed.len() as u64 > u64::from(limits.max_tlas_instance_count) {
            return Err(refused(gpu, &format!("{} instances", parts.placed.len())));
        }
        let scope = gpu.device().push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let built = Self::submit(gpu, parts);
        match pollster::block_on(scope.pop()) {
            None => Ok(built),
            Some(_) => Err(refused(gpu, "that much memory")),
        }
    }

    fn submit(gpu: &Gpu, parts: &Parts) -> Self {
        let trees: Vec<_> = parts.parts.iter().map(|part| PartTree::new(gpu, part)).collect();
        let mut tlas = gpu.device().create_tlas(&wgpu::CreateTlasDescriptor {
            label: Some("instances"),
            max_instances: parts.placed.len() as u32,
            flags: FLAGS,
            update_mode: UPDATES,
        });
        for (i, &(part, map)) in parts.placed.iter().enumerate() {
            let tree = trees[part].as_ref().expect("instances are of parts with triangles");
            // Rows of the map, the last left out.
            let rows = Mat4::from(map).transpose().to_cols_array();
            let mut transform = [0.0; 12];
            transform.copy_from_slice(&rows[..12]);
            tlas[i] = Some(wgpu::TlasInstance::new(&tree.blas, transform, 0, u8::MAX));
        }
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        let entries: Vec<_> = trees.iter().flatten().map(PartTree::entry).collect();
        encoder.build_acceleration_structures(&entries, [&tlas]);
        gpu.queue().submit([encoder.finish()]);
        let triangles: usize = parts.parts.iter().map(|p| p.corners.len()).sum();
        let bytes = triangles as u64 * TRIANGLE_BYTES + parts.placed.len() as u64 * INSTANCE_BYTES;
        Self { tlas, _bytes: gpu.hold_bytes("acceleration structures", bytes) }
    }

    /// What the scene's group binds.
    pub(super) fn binding(&self) -> wgpu::BindingResource<'_> {
        self.tlas.as_binding()
    }
}

/// What the device does not allow.
fn refused(gpu: &Gpu, what: &str) -> Error {
    Error::Device {
        problem: format!(
            "the hardware's hierarchy of rays needs {what}, and {} does not allow it; render \
             without ray queries (--set gpu.ray_queries=false)",
            gpu.name()
        ),
    }
}

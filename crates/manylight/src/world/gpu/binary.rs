//! A binary hierarchy on the device, to measure the eight-wide one against.

use super::{CastBinary, CastParams};
use crate::bvh::gpu::{BinaryNode, BinaryTree};
use crate::error::Error;
use crate::gpu::{Buf, Gpu};
use crate::world::World;
use glam::Vec3;

/// Nodes and triangles of one hierarchy.
#[derive(Debug)]
pub struct BinaryWorld {
    nodes: Buf<BinaryNode>,
    triangles: Buf<[f32; 12]>,
}

impl BinaryWorld {
    /// Copies a hierarchy of all triangles to the device; none where meshes are shared or there are
    /// no triangles.
    ///
    /// Errors: a list that the device cannot hold in one binding
    pub fn new(gpu: &Gpu, world: &World) -> Result<Option<Self>, Error> {
        let placed = world.flat_corners();
        if !world.placements.is_empty() || placed.is_empty() {
            return Ok(None);
        }
        let boxes: Vec<[Vec3; 2]> =
            placed.iter().map(|t| crate::world::bounds_of(t.corners.into_iter())).collect();
        let tree = BinaryTree::build(&boxes);
        let triangles: Vec<_> = tree.order.iter().map(|&i| placed[i as usize].words(i)).collect();
        Ok(Some(Self {
            nodes: gpu.upload("nodes of the binary hierarchy", &tree.nodes)?,
            triangles: gpu.upload("triangles of the binary hierarchy", &triangles)?,
        }))
    }

    /// The kernel that finds which of some rays are stopped.
    pub fn cast<'a>(
        &'a self,
        params: crate::gpu::Uniform<CastParams>,
        rays: &'a Buf<[f32; 8]>,
        stopped: &'a Buf<u32>,
    ) -> CastBinary<'a> {
        CastBinary { params, rays, nodes: &self.nodes, triangles: &self.triangles, stopped }
    }
}

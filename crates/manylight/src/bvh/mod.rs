//! Rays against triangles: an eight-wide bounding volume hierarchy.
//!
//! In: triangles with an opacity flag · Out: [`Bvh`], closest hit and any hit
//! In: boxes · Out: [`BoxTree`], the boxes along a ray
//! Paper: `[Wald14]` for wide nodes and triangle packs, `[Ylitie17]` for collapsing a binary tree
//! (built by obvhs, PLOC) to them, `[IzeHansen11]` for the order of children.
//! Limits: at most 2³¹ − 1 triangles or boxes and 72 levels; bounds are not refitted.

mod balanced;
mod boxes;
mod build;
mod collapse;
#[cfg(feature = "gpu")]
pub mod gpu;
mod lanes;
mod order;
mod pack;
mod traverse;
mod triangles;

pub use boxes::BoxTree;
pub use traverse::Ray;
pub use triangles::RayHit;

use pack::{Node, Pack};

/// Children per node and triangles per leaf pack.
const WIDTH: usize = 8;

/// Most triangles or boxes: one bit of a reference and of an id is a flag, and all ones mark what
/// is empty. Building more panics.
const MAX_COUNT: usize = (1 << 31) - 1;

/// Most levels of nodes; the traversal's stack has room for no more.
const MAX_DEPTH: usize = 72;

/// A triangle handed to the builder.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    /// Corners.
    pub corners: [glam::Vec3; 3],
    /// Whether every ray that meets it is stopped, without asking the caller.
    pub opaque: bool,
}

/// A hierarchy over triangles that are known by their position in the builder's list.
#[derive(Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    packs: Vec<Pack>,
}

#[cfg(test)]
mod tests;

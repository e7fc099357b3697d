//! The hierarchy of the graphics device: eight-wide nodes with boxes in bytes.
//!
//! In: boxes · Out: [`GpuTree`], and [`BinaryTree`] to measure it against
//! Paper: `[Ylitie17]`; the binary tree and its conversion by obvhs.
//! Limits: at most 32 levels; what a tree by cost would exceed becomes a balanced one.

use super::balanced::build_balanced;
use super::build::{build_by_cost, is_stacked};
use super::triangles::EDGE_SLACK;
use crate::gpu::{Constant, Value, record};
use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;

/// Levels that a traversal has room for.
const STACK: usize = 32;
/// Most levels of a binary tree: its conversion works by recursion.
const MAX_BINARY_DEPTH: usize = 1024;
/// Most boxes per leaf: what the node's format has room for.
const LEAF_SIZE: u32 = 3;
/// Levels of a binary tree that its traversal has room for.
const BINARY_STACK: usize = 64;
/// What a visit of a node of a binary tree costs, in tests of a box in a leaf.
const BINARY_VISIT: f32 = 1.0;
/// Words of a node.
pub const NODE_WORDS: usize = 20;

/// Constants of `traverse.wgsl` and `traverse_binary.wgsl`.
pub const CONSTANTS: &[Constant] = &[
    Constant { name: "STACK", value: Value::U32(STACK as u32) },
    Constant { name: "BINARY_STACK", value: Value::U32(BINARY_STACK as u32) },
    Constant { name: "EDGE_SLACK", value: Value::F32(EDGE_SLACK) },
];

/// A hierarchy ready for the device.
#[derive(Clone, Debug, Default)]
pub struct GpuTree {
    /// Nodes, the root first; empty without boxes.
    pub nodes: Vec<[u32; NODE_WORDS]>,
    /// Leaf order → position in the builder's list.
    pub order: Vec<u32>,
}

impl GpuTree {
    /// Builds the hierarchy of boxes, given by their least and greatest corners.
    ///
    /// Errors: never; without boxes every ray misses
    /// Cost:   O(n log n); about 30 B per box
    pub fn build(boxes: &[[Vec3; 2]]) -> Self {
        let boxes = bounds(boxes);
        if boxes.is_empty() {
            return Self::default();
        }
        let by_cost = (!is_stacked(&boxes)).then(|| build_by_cost(&boxes));
        let tree = by_cost.filter(|tree| depth(tree) <= MAX_BINARY_DEPTH).and_then(|t| wide(&t));
        let balanced = || wide(&build_balanced(&boxes, 1)).expect("a balanced tree is shallow");
        tree.unwrap_or_else(balanced)
    }
}

record! {
    /// A node of a binary hierarchy.
    pub struct BinaryNode {
        /// Least corner of its box.
        pub low: [f32; 3],
        /// The first of its two children, or the first place of a leaf.
        pub first: u32,
        /// Greatest corner of its box.
        pub high: [f32; 3],
        /// Places of a leaf; zero where it has children.
        pub count: u32,
    }
}

/// A binary hierarchy ready for the device.
#[derive(Clone, Debug, Default)]
pub struct BinaryTree {
    /// Nodes, the root first; empty without boxes.
    pub nodes: Vec<BinaryNode>,
    /// Leaf order → position in the builder's list.
    pub order: Vec<u32>,
}

impl BinaryTree {
    /// Builds the hierarchy of boxes, given by their least and greatest corners.
    ///
    /// Errors: never; without boxes there is no node
    /// Cost:   O(n log n); about 70 B per box
    pub fn build(boxes: &[[Vec3; 2]]) -> Self {
        let boxes = bounds(boxes);
        if boxes.is_empty() {
            return Self::default();
        }
        let by_cost = (!is_stacked(&boxes)).then(|| {
            let mut tree = build_by_cost(&boxes);
            obvhs::bvh2::leaf_collapser::collapse(&mut tree, LEAF_SIZE, BINARY_VISIT);
            tree
        });
        let shallow = by_cost.filter(|tree| depth(tree) <= BINARY_STACK);
        let tree = shallow.unwrap_or_else(|| build_balanced(&boxes, 1));
        let record = |node: &Bvh2Node| BinaryNode {
            low: node.aabb.min.to_array(),
            first: node.first_index,
            high: node.aabb.max.to_array(),
            count: node.prim_count,
        };
        Self { nodes: tree.nodes.iter().map(record).collect(), order: tree.primitive_indices }
    }
}

fn bounds(boxes: &[[Vec3; 2]]) -> Vec<Aabb> {
    boxes.iter().map(|[low, high]| Aabb::new((*low).into(), (*high).into())).collect()
}

/// The wide tree of a binary one; none if it has too many levels.
fn wide(binary: &Bvh2) -> Option<GpuTree> {
    let wide = bvh2_to_cwbvh(binary, LEAF_SIZE, true, false);
    // Levels below each node; children come after their parents.
    let mut depths = vec![1usize; wide.nodes.len()];
    for (i, node) in wide.nodes.iter().enumerate().rev() {
        let children = (0..8).filter(|&c| node.imask >> c & 1 == 1);
        let below = children.map(|c| depths[node.child_node_index(c) as usize]).max();
        depths[i] = 1 + below.unwrap_or(0);
    }
    let nodes = wide.nodes.iter().map(|node| bytemuck::cast(*node)).collect();
    (depths[0] <= STACK).then_some(GpuTree { nodes, order: wide.primitive_indices })
}

/// Levels of a binary tree.
fn depth(tree: &Bvh2) -> usize {
    let (mut deepest, mut open) = (0, vec![(0usize, 1)]);
    while let Some((index, depth)) = open.pop() {
        deepest = deepest.max(depth);
        let node = &tree.nodes[index];
        if !node.is_leaf() {
            let first = node.first_index as usize;
            open.extend([(first, depth + 1), (first + 1, depth + 1)]);
        }
    }
    deepest
}

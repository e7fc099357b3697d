//! A binary tree whose depth is bounded whatever the boxes are.
//!
//! In: boxes · Out: a tree split at the median of the centers
//! Limits: slower to traverse than a tree built by cost; for scenes that make that one a chain.

use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, node::Bvh2Node};

/// Splits in the middle of the axis along which the centers are spread most.
///
/// A leaf holds at most `leaf_boxes`.
///
/// Cost: O(n log n); depth log2 n
pub(super) fn build_balanced(boxes: &[Aabb], leaf_boxes: usize) -> Bvh2 {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = vec![Bvh2Node::default()];
    let mut work = vec![(0, 0..boxes.len())];
    while let Some((node, range)) = work.pop() {
        let ids = &mut order[range.clone()];
        let (mut bounds, mut centers) = (Aabb::INVALID, Aabb::INVALID);
        for &id in ids.iter() {
            bounds = bounds.union(&boxes[id as usize]);
            centers.extend(boxes[id as usize].center());
        }
        if ids.len() <= leaf_boxes {
            nodes[node] = Bvh2Node::new(bounds, ids.len() as u32, range.start as u32);
            continue;
        }
        let axis = centers.diagonal().max_position();
        let half = ids.len() / 2;
        let center = |id: &u32| boxes[*id as usize].center()[axis];
        ids.select_nth_unstable_by(half, |a, b| center(a).total_cmp(&center(b)));
        let first = nodes.len();
        nodes[node] = Bvh2Node::new(bounds, 0, first as u32);
        nodes.extend([Bvh2Node::default(); 2]);
        let middle = range.start + half;
        work.extend([(first, range.start..middle), (first + 1, middle..range.end)]);
    }
    Bvh2 { nodes, primitive_indices: order, ..Bvh2::default() }
}

//! The order of children: the one in which any-hit rays end soonest.
//!
//! In: nodes, what rays may expect of the leaves · Out: the same nodes with their slots sorted
//! Paper: `[IzeHansen11]` for the order: the chance to stop a ray, by the expected work.
//! Limits: chances are those of uniform lines, taken as independent.

use super::WIDTH;
use super::pack::{EMPTY, LEAF, Node};

/// What a ray that enters a node or leaf may expect.
#[derive(Clone, Copy)]
struct Expected {
    /// Probability to be stopped.
    stop: f32,
    /// Nodes and leaves visited until it is stopped or has left.
    visits: f32,
}

/// Sorts the children of all nodes: most stopped rays per visit first.
///
/// `leaf_areas` holds the opaque area in each leaf.
///
/// Cost: O(n); nodes must lie before their children
pub(super) fn sort_children(nodes: &mut [Node], leaf_areas: &[f32]) {
    let mut expected = vec![Expected { stop: 0.0, visits: 1.0 }; nodes.len()];
    for index in (0..nodes.len()).rev() {
        let node = nodes[index];
        let expect = |slot: usize| {
            let child = node.children[slot];
            if child & LEAF == 0 {
                return expected[child as usize];
            }
            // A line meets a triangle in a convex box with 2 · area / surface of the box.
            let density = leaf_areas[(child & !LEAF) as usize] / slot_half_area(&node, slot);
            let stop = if density.is_nan() { 0.0 } else { 1.0 - (-density).exp() };
            Expected { stop, visits: 1.0 }
        };
        let full = (0..WIDTH).filter(|&slot| node.children[slot] != EMPTY);
        let mut order: Vec<(usize, Expected)> = full.map(|slot| (slot, expect(slot))).collect();
        let worth = |e: &Expected| e.stop / e.visits;
        order.sort_by(|(_, a), (_, b)| worth(b).total_cmp(&worth(a)));

        let mut sorted = Node::EMPTY;
        let mut whole = Expected { stop: 0.0, visits: 1.0 };
        let area = whole_half_area(&node);
        for (to, &(from, child)) in order.iter().enumerate() {
            // Boxes without area are entered as if they filled the node.
            let enter = slot_half_area(&node, from) / area;
            let reach = if enter <= 1.0 { enter } else { 1.0 } * (1.0 - whole.stop);
            whole.visits += reach * child.visits;
            whole.stop += reach * child.stop;
            for axis in 0..3 {
                for side in 0..2 {
                    sorted.planes[axis][side][to] = node.planes[axis][side][from];
                }
            }
            sorted.children[to] = node.children[from];
        }
        expected[index] = whole;
        nodes[index] = sorted;
    }
}

fn slot_half_area(node: &Node, slot: usize) -> f32 {
    half_area(node.planes.map(|[low, high]| high[slot] - low[slot]))
}

/// Half the surface of the box around all children.
fn whole_half_area(node: &Node) -> f32 {
    half_area(node.planes.map(|[low, high]| {
        let low = low.into_iter().fold(f32::INFINITY, f32::min);
        high.into_iter().fold(f32::NEG_INFINITY, f32::max) - low
    }))
}

fn half_area([x, y, z]: [f32; 3]) -> f32 {
    x * y + y * z + z * x
}

//! Collapsing a binary tree to eight-wide nodes at least cost.
//!
//! In: a binary tree · Out: [`Wide`], nodes over leaves of a few ids
//! Paper: `[Ylitie17]`, Section 3.1: subtrees cut into at most k roots, by dynamic programming.

use super::WIDTH;
use super::pack::{EMPTY, LEAF, Node};
use obvhs::bvh2::Bvh2;
use std::ops::Range;

/// A wide tree whose leaves are ranges of ids.
pub(super) struct Wide {
    /// Parents before children.
    pub nodes: Vec<Node>,
    pub leaves: Vec<Range<usize>>,
    /// Positions in the builder's list.
    pub ids: Vec<u32>,
    /// Levels of nodes.
    pub depth: usize,
}

impl Wide {
    /// A tree without leaves.
    pub fn empty() -> Self {
        Self { nodes: vec![Node::EMPTY], leaves: Vec::new(), ids: Vec::new(), depth: 1 }
    }
}

/// The wide tree over a binary one; a leaf holds at most `leaf_size` ids, more where a binary
/// leaf does.
///
/// Cost: O(n)
pub(super) fn collapse(tree: &Bvh2, leaf_size: u32) -> Wide {
    let plans = make_plans(tree, leaf_size);
    let mut collapse = Collapse { tree, plans: &plans, wide: Wide::empty() };
    collapse.fill();
    collapse.wide
}

/// What becomes of a binary node.
#[derive(Clone, Copy)]
struct Plan {
    /// `[k]`: least cost of the subtree in at most k + 1 slots of a wide node; a visit costs the
    /// half area of its box, for a node and for a leaf.
    costs: [f32; WIDTH],
    /// Ids below.
    count: u32,
    /// Whether one slot holds it as a leaf: that costs a visit, as a node would before its leaves.
    is_leaf: bool,
}

fn make_plans(tree: &Bvh2, leaf_size: u32) -> Vec<Plan> {
    // Parents before children; a list, as binary trees over bad scenes can be very deep.
    let mut order = vec![0u32];
    let mut next = 0;
    while next < order.len() {
        let node = &tree.nodes[order[next] as usize];
        if !node.is_leaf() {
            order.extend([node.first_index, node.first_index + 1]);
        }
        next += 1;
    }
    let none = Plan { costs: [0.0; WIDTH], count: 0, is_leaf: true };
    let mut plans = vec![none; tree.nodes.len()];
    for &index in order.iter().rev() {
        let node = &tree.nodes[index as usize];
        let area = node.aabb().half_area();
        let first = node.first_index as usize;
        plans[index as usize] = if node.is_leaf() {
            Plan { costs: [area; WIDTH], count: node.prim_count, is_leaf: true }
        } else {
            join(&plans[first], &plans[first + 1], area, leaf_size)
        };
    }
    plans
}

/// The plan of a node over two others.
fn join(left: &Plan, right: &Plan, area: f32, leaf_size: u32) -> Plan {
    let mut costs = [f32::INFINITY; WIDTH];
    for (k, cost) in costs.iter_mut().enumerate().skip(1) {
        *cost = (0..k).map(|i| left.costs[i] + right.costs[k - 1 - i]).fold(*cost, f32::min);
    }
    let count = left.count + right.count;
    let is_leaf = count <= leaf_size;
    costs[0] = if is_leaf { area } else { area + costs[WIDTH - 1] };
    for k in 1..WIDTH {
        costs[k] = costs[k].min(costs[k - 1]);
    }
    Plan { costs, count, is_leaf }
}

struct Collapse<'a> {
    tree: &'a Bvh2,
    plans: &'a [Plan],
    wide: Wide,
}

impl Collapse<'_> {
    /// Fills all nodes, parents before children.
    fn fill(&mut self) {
        let mut work = vec![(0u32, 0u32, 1)];
        let mut children = Vec::with_capacity(WIDTH);
        while let Some((binary, wide, depth)) = work.pop() {
            self.wide.depth = self.wide.depth.max(depth);
            children.clear();
            if self.plans[binary as usize].is_leaf {
                children.push(binary);
            } else {
                self.divide(binary, WIDTH - 1, &mut children);
            }
            for (slot, &child) in children.iter().enumerate() {
                let aabb = *self.tree.nodes[child as usize].aabb();
                let target = if self.plans[child as usize].is_leaf {
                    LEAF | self.push_leaf(child)
                } else {
                    self.wide.nodes.push(Node::EMPTY);
                    let index = (self.wide.nodes.len() - 1) as u32;
                    work.push((child, index, depth + 1));
                    index
                };
                let node = &mut self.wide.nodes[wide as usize];
                for axis in 0..3 {
                    node.planes[axis][0][slot] = aabb.min[axis];
                    node.planes[axis][1][slot] = aabb.max[axis];
                }
                node.children[slot] = target;
            }
        }
        debug_assert!(self.wide.nodes[0].children[0] != EMPTY);
    }

    /// Lists the roots into which at most `more` + 1 slots cut a subtree.
    fn cut(&self, binary: u32, mut more: usize, roots: &mut Vec<u32>) {
        let costs = &self.plans[binary as usize].costs;
        while more > 0 && costs[more] >= costs[more - 1] {
            more -= 1;
        }
        // Costs of boxes beyond the numbers say nothing, not even where there are no children.
        if more == 0 || self.tree.nodes[binary as usize].is_leaf() {
            roots.push(binary);
        } else {
            self.divide(binary, more, roots);
        }
    }

    /// The same where both children get a slot at least.
    fn divide(&self, binary: u32, more: usize, roots: &mut Vec<u32>) {
        let first = self.tree.nodes[binary as usize].first_index;
        let (left, right) = (&self.plans[first as usize], &self.plans[first as usize + 1]);
        let cost = |i: usize| left.costs[i] + right.costs[more - 1 - i];
        let best = (0..more).min_by(|&i, &j| cost(i).total_cmp(&cost(j))).unwrap_or(0);
        self.cut(first, best, roots);
        self.cut(first + 1, more - 1 - best, roots);
    }

    fn push_leaf(&mut self, binary: u32) -> u32 {
        let begin = self.wide.ids.len();
        let mut stack = vec![binary];
        while let Some(index) = stack.pop() {
            let node = &self.tree.nodes[index as usize];
            if node.is_leaf() {
                let first = node.first_index as usize;
                let ids = &self.tree.primitive_indices[first..first + node.prim_count as usize];
                self.wide.ids.extend(ids);
            } else {
                stack.extend([node.first_index, node.first_index + 1]);
            }
        }
        self.wide.leaves.push(begin..self.wide.ids.len());
        (self.wide.leaves.len() - 1) as u32
    }
}

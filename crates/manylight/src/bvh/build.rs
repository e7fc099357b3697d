//! Building: a binary tree by obvhs, or a balanced one where that would take too long or
//! be too deep, collapsed to eight-wide nodes over triangle packs.

use super::balanced::build_balanced;
use super::pack::{EMPTY, LEAF, Node, OPAQUE, Pack};
use super::{Bvh, MAX_DEPTH, Triangle, WIDTH};
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2};

impl Bvh {
    /// Builds the hierarchy of `triangles`.
    ///
    /// Errors: never; without triangles every ray misses.
    /// Cost:   O(n log n); about 60 B per triangle
    pub fn build(triangles: &[Triangle]) -> Self {
        let boxes: Vec<Aabb> =
            triangles.iter().map(|t| Aabb::from_points(&t.corners.map(Into::into))).collect();
        if boxes.is_empty() {
            return Self { nodes: vec![Node::EMPTY], packs: Vec::new() };
        }
        if !is_stacked(&boxes) {
            let params = BvhBuildParams { max_prims_per_leaf: 4, ..BvhBuildParams::medium_build() };
            let time = &mut std::time::Duration::default();
            let tree = obvhs::bvh2::builder::build_bvh2(&boxes, params, time);
            let (bvh, depth) = collapse(&tree, triangles);
            if depth <= MAX_DEPTH {
                return bvh;
            }
        }
        collapse(&build_balanced(&boxes), triangles).0
    }
}

/// The wide tree with the same leaves, and its number of levels.
fn collapse(tree: &Bvh2, triangles: &[Triangle]) -> (Bvh, usize) {
    let mut bvh = Bvh { nodes: vec![Node::EMPTY], packs: Vec::new() };
    let counts = count_triangles(tree);
    let depth = Collapse { tree, counts: &counts, triangles, bvh: &mut bvh }.fill_root();
    (bvh, depth)
}

/// Boxes that cover the scene's box more often than this are no case for a tree by cost.
const MAX_OVERLAP: f32 = 1000.0;

/// Whether most boxes lie in one another, as those of triangles stacked at one place.
///
/// The builder merges one pair per pass where one neighbor suits all: its time grows with the
/// square of their number, and gives a chain.
fn is_stacked(boxes: &[Aabb]) -> bool {
    let whole = boxes.iter().fold(Aabb::INVALID, |whole, aabb| whole.union(aabb));
    let sum: f32 = boxes.iter().map(|aabb| aabb.half_area() / whole.half_area()).sum();
    sum > MAX_OVERLAP
}

/// Triangles below each binary node.
fn count_triangles(tree: &Bvh2) -> Vec<u32> {
    let mut order = vec![0u32];
    let mut next = 0;
    while next < order.len() {
        let node = &tree.nodes[order[next] as usize];
        if !node.is_leaf() {
            order.extend([node.first_index, node.first_index + 1]);
        }
        next += 1;
    }
    let mut counts = vec![0u32; tree.nodes.len()];
    for &index in order.iter().rev() {
        let node = &tree.nodes[index as usize];
        let first = node.first_index as usize;
        counts[index as usize] =
            if node.is_leaf() { node.prim_count } else { counts[first] + counts[first + 1] };
    }
    counts
}

struct Collapse<'a> {
    tree: &'a Bvh2,
    counts: &'a [u32],
    triangles: &'a [Triangle],
    bvh: &'a mut Bvh,
}

impl Collapse<'_> {
    fn is_leaf(&self, index: u32) -> bool {
        self.counts[index as usize] <= WIDTH as u32
    }

    /// Fills all nodes; returns the number of their levels.
    fn fill_root(&mut self) -> usize {
        let mut deepest = 0;
        // Work list instead of recursion: binary trees over bad scenes can be very deep.
        let mut work = vec![(0u32, 0u32, 1)];
        while let Some((binary, wide, depth)) = work.pop() {
            deepest = deepest.max(depth);
            for (slot, child) in self.gather_children(binary).into_iter().enumerate() {
                let aabb = *self.tree.nodes[child as usize].aabb();
                let target = if self.is_leaf(child) {
                    LEAF | self.push_pack(child)
                } else {
                    self.bvh.nodes.push(Node::EMPTY);
                    let index = (self.bvh.nodes.len() - 1) as u32;
                    work.push((child, index, depth + 1));
                    index
                };
                let node = &mut self.bvh.nodes[wide as usize];
                for axis in 0..3 {
                    node.planes[axis][0][slot] = aabb.min[axis];
                    node.planes[axis][1][slot] = aabb.max[axis];
                }
                node.children[slot] = target;
            }
        }
        debug_assert!(self.bvh.nodes[0].children[0] != EMPTY);
        deepest
    }

    /// Opens the largest inner child until eight are found.
    fn gather_children(&self, binary: u32) -> Vec<u32> {
        let mut children = vec![binary];
        while children.len() < WIDTH {
            let area = |c: &u32| self.tree.nodes[*c as usize].aabb().half_area();
            let largest = (0..children.len())
                .filter(|&i| !self.is_leaf(children[i]))
                .max_by(|&a, &b| area(&children[a]).total_cmp(&area(&children[b])));
            let Some(i) = largest else { break };
            let first = self.tree.nodes[children[i] as usize].first_index;
            children[i] = first;
            children.push(first + 1);
        }
        children
    }

    fn push_pack(&mut self, binary: u32) -> u32 {
        let mut pack = Pack::EMPTY;
        let mut lane = 0;
        let mut stack = vec![binary];
        while let Some(index) = stack.pop() {
            let node = &self.tree.nodes[index as usize];
            if !node.is_leaf() {
                stack.extend([node.first_index, node.first_index + 1]);
                continue;
            }
            for k in node.first_index..node.first_index + node.prim_count {
                let id = self.tree.primitive_indices[k as usize];
                let triangle = &self.triangles[id as usize];
                let [a, b, c] = triangle.corners;
                for axis in 0..3 {
                    pack.corner[axis][lane] = a[axis];
                    pack.edge1[axis][lane] = b[axis] - a[axis];
                    pack.edge2[axis][lane] = c[axis] - a[axis];
                }
                pack.id[lane] = id | if triangle.opaque { OPAQUE } else { 0 };
                lane += 1;
            }
        }
        self.bvh.packs.push(pack);
        (self.bvh.packs.len() - 1) as u32
    }
}

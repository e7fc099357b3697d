//! Building: a binary tree by obvhs, or a balanced one where that would take too long or
//! be too deep, and the wide one from it.

use super::balanced::build_balanced;
use super::collapse::{Wide, collapse};
use super::order::sort_children;
use super::pack::{OPAQUE, Pack};
use super::{BoxTree, Bvh, MAX_COUNT, MAX_DEPTH, Triangle, WIDTH};
use glam::Vec3;
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2};
use rayon::prelude::*;

impl Bvh {
    /// Builds the hierarchy of `triangles`.
    ///
    /// Errors: never; without triangles every ray misses.
    /// Cost:   O(n log n); about 80 B per triangle, 250 B while it builds
    pub fn build(triangles: &[Triangle]) -> Self {
        let boxes: Vec<Aabb> =
            triangles.iter().map(|t| Aabb::from_points(&t.corners.map(Into::into))).collect();
        let Wide { mut nodes, leaves, ids, .. } = build_wide(&boxes, WIDTH as u32);
        let mut packs = Vec::with_capacity(leaves.len());
        let mut areas = Vec::with_capacity(leaves.len());
        for leaf in leaves {
            packs.push(make_pack(&ids[leaf.clone()], triangles));
            areas.push(ids[leaf].iter().map(|&id| opaque_area(&triangles[id as usize])).sum());
        }
        sort_children(&mut nodes, &areas);
        Self { nodes, packs }
    }
}

impl BoxTree {
    /// Builds the hierarchy of boxes, given by their least and greatest corners.
    ///
    /// Errors: never; without boxes every ray misses.
    /// Cost:   O(n log n); about 50 B per box, 250 B while it builds
    pub fn build(boxes: &[[Vec3; 2]]) -> Self {
        let boxes: Vec<Aabb> =
            boxes.iter().map(|[low, high]| Aabb::new((*low).into(), (*high).into())).collect();
        let Wide { mut nodes, leaves, ids, .. } = build_wide(&boxes, 1);
        debug_assert!(leaves.iter().enumerate().all(|(i, leaf)| *leaf == (i..i + 1)));
        // What is in a box may well stop a ray: all alike, a share of their surface.
        let areas: Vec<f32> = ids.iter().map(|&id| boxes[id as usize].half_area() * 0.5).collect();
        sort_children(&mut nodes, &areas);
        Self { nodes, items: ids }
    }
}

/// Most levels or a stack of boxes: the balanced tree; else the one of least cost.
fn build_wide(boxes: &[Aabb], leaf_size: u32) -> Wide {
    assert!(boxes.len() <= MAX_COUNT, "{} triangles or boxes are too many", boxes.len());
    if boxes.is_empty() {
        return Wide::empty();
    }
    if !is_stacked(boxes) {
        let wide = collapse(&build_by_cost(boxes), leaf_size);
        if wide.depth <= MAX_DEPTH {
            return wide;
        }
    }
    collapse(&build_balanced(boxes, leaf_size as usize), leaf_size)
}

pub(super) fn build_by_cost(boxes: &[Aabb]) -> Bvh2 {
    let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
    obvhs::bvh2::builder::build_bvh2(boxes, params, &mut std::time::Duration::default())
}

/// Boxes that cover the scene's box more often than this are no case for a tree by cost.
const MAX_OVERLAP: f32 = 1000.0;
/// Nor are boxes with more than this like each of them, wherever they lie.
const MAX_ALIKE: f32 = 256.0;

/// Whether many boxes lie in one another, as those of triangles stacked at one place.
///
/// The builder merges one pair per pass where one neighbor suits all: its time grows with the
/// square of their number, and gives a chain.
pub(super) fn is_stacked(boxes: &[Aabb]) -> bool {
    let whole = boxes.iter().fold(Aabb::INVALID, |whole, aabb| whole.union(aabb));
    let sum: f32 = boxes.iter().map(|aabb| aabb.half_area() / whole.half_area()).sum();
    // NaN where the whole has no area, or none that a float holds: costs would say nothing.
    sum.is_nan() || sum > MAX_OVERLAP || count_alike(boxes) > MAX_ALIKE
}

/// How many boxes are like a box, itself included, as the mean over all boxes.
///
/// Those are alike whose corners fall into the same cells of about 1/16 of their size.
///
/// Cost: O(n log n), 8 B per box
fn count_alike(boxes: &[Aabb]) -> f32 {
    let mut keys: Vec<u64> = boxes.par_iter().map(alike_key).collect();
    keys.par_sort_unstable();
    let square = |run: &[u64]| run.len() as f64 * run.len() as f64;
    let sum: f64 = keys.chunk_by(|a, b| a == b).map(square).sum();
    (sum / boxes.len() as f64) as f32
}

/// The same number for boxes that are alike, and hardly ever for others.
fn alike_key(aabb: &Aabb) -> u64 {
    let (low, high) = (Vec3::from(aabb.min), Vec3::from(aabb.max));
    // A power of two, and no less than the roundings of the corners.
    let size = (high - low).max_element().max(low.abs().max(high.abs()).max_element() * 1e-6);
    let cell = f32::from_bits(size.to_bits() & 0x7f80_0000) * 0.0625;
    let numbers = [low.x, low.y, low.z, high.x, high.y, high.z].map(|x| (x / cell).floor() + 0.0);
    numbers.into_iter().chain([cell]).fold(0, |key: u64, number| {
        (key.rotate_left(23) ^ u64::from(number.to_bits())).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    })
}

fn make_pack(ids: &[u32], triangles: &[Triangle]) -> Pack {
    let mut pack = Pack::EMPTY;
    for (lane, &id) in ids.iter().enumerate() {
        let triangle = &triangles[id as usize];
        let [a, b, c] = triangle.corners;
        for axis in 0..3 {
            pack.corner[axis][lane] = a[axis];
            pack.edge1[axis][lane] = b[axis] - a[axis];
            pack.edge2[axis][lane] = c[axis] - a[axis];
        }
        pack.id[lane] = id | if triangle.opaque { OPAQUE } else { 0 };
    }
    pack
}

/// Area of a triangle that surely stops rays.
fn opaque_area(triangle: &Triangle) -> f32 {
    let [a, b, c] = triangle.corners;
    if triangle.opaque { (b - a).cross(c - a).length() * 0.5 } else { 0.0 }
}

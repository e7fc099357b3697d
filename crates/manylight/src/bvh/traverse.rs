//! Traversal: one node or one pack at a time, eight lanes at once.
//!
//! The bodies are written once over plain lane arrays and compiled twice on x86-64: for the
//! baseline and for AVX2, chosen when a ray starts. No fused multiply-add is used, so both give
//! the same bits.

use super::pack::{LEAF, Lanes, NO_TRIANGLE, Node, OPAQUE, Pack};
use super::{Bvh, MAX_DEPTH, WIDTH};
use glam::Vec3;

/// A half-open segment `origin + t·direction`, 0 < t < t_max.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start.
    pub origin: Vec3,
    /// Need not be unit.
    pub direction: Vec3,
    /// End, in units of `direction`.
    pub t_max: f32,
}

/// Where a ray met a triangle.
#[derive(Clone, Copy, Debug)]
pub struct RayHit {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// Barycentrics of the second and third corner.
    pub barycentrics: [f32; 2],
    /// Position in the builder's list.
    pub triangle: u32,
}

/// Deepest stack: the siblings of every level, and the last node's children.
const STACK_SIZE: usize = MAX_DEPTH * (WIDTH - 1) + WIDTH;

/// Lets barycentrics pass an edge by this, so that no ray slips between two triangles.
const EDGE_SLACK: f32 = 1e-6;

struct Prepared {
    origin: [f32; 3],
    direction: [f32; 3],
    inverse: [f32; 3],
    /// Index of the near plane per axis.
    near: [usize; 3],
}

impl Prepared {
    fn new(ray: &Ray) -> Self {
        let inverse = ray.direction.to_array().map(|d| {
            // A zero component must not make 0·∞ = NaN where the origin lies on a plane.
            1.0 / if d.abs() < 1e-30 { 1e-30f32.copysign(d) } else { d }
        });
        let near = inverse.map(|i| usize::from(i < 0.0));
        Self { origin: ray.origin.to_array(), direction: ray.direction.to_array(), inverse, near }
    }
}

impl Bvh {
    /// The nearest hit that `accept` agrees to.
    ///
    /// `accept` is asked only about triangles that are not opaque.
    #[inline]
    pub fn closest(&self, ray: &Ray, accept: impl FnMut(&RayHit) -> bool) -> Option<RayHit> {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.closest_avx2(ray, accept) };
        }
        self.closest_lanes(ray, accept)
    }

    /// Whether any triangle that `accept` agrees to stops the ray.
    #[inline]
    pub fn occluded(&self, ray: &Ray, accept: impl FnMut(&RayHit) -> bool) -> bool {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            return unsafe { self.occluded_avx2(ray, accept) };
        }
        self.occluded_lanes(ray, accept)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn closest_avx2(&self, ray: &Ray, accept: impl FnMut(&RayHit) -> bool) -> Option<RayHit> {
        self.closest_lanes(ray, accept)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn occluded_avx2(&self, ray: &Ray, accept: impl FnMut(&RayHit) -> bool) -> bool {
        self.occluded_lanes(ray, accept)
    }

    #[inline(always)]
    fn closest_lanes(&self, ray: &Ray, mut accept: impl FnMut(&RayHit) -> bool) -> Option<RayHit> {
        let prepared = Prepared::new(ray);
        let mut best: Option<RayHit> = None;
        let mut t_max = ray.t_max;
        let mut stack = [(0u32, 0.0f32); STACK_SIZE];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (reference, t_near) = stack[depth];
            if t_near >= t_max {
                continue;
            }
            if reference & LEAF != 0 {
                let pack = &self.packs[(reference & !LEAF) as usize];
                let (mask, t, u, v) = intersect_pack(pack, &prepared, t_max);
                for lane in lanes_of(mask) {
                    let (hit, is_opaque) = hit_in(pack, lane, [t[lane], u[lane], v[lane]]);
                    if hit.t < t_max && (is_opaque || accept(&hit)) {
                        t_max = hit.t;
                        best = Some(hit);
                    }
                }
                continue;
            }
            // Push far to near, by insertion.
            let node = &self.nodes[reference as usize];
            let (mask, t_near) = intersect_node(node, &prepared, t_max);
            let base = depth;
            for lane in lanes_of(mask) {
                let entry = (node.children[lane], t_near[lane]);
                let mut i = depth;
                while i > base && stack[i - 1].1 < entry.1 {
                    stack[i] = stack[i - 1];
                    i -= 1;
                }
                stack[i] = entry;
                depth += 1;
            }
        }
        best
    }

    #[inline(always)]
    fn occluded_lanes(&self, ray: &Ray, mut accept: impl FnMut(&RayHit) -> bool) -> bool {
        let prepared = Prepared::new(ray);
        let mut stack = [0u32; STACK_SIZE];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let node = &self.nodes[stack[depth] as usize];
            let (mask, _) = intersect_node(node, &prepared, ray.t_max);
            for lane in lanes_of(mask) {
                let reference = node.children[lane];
                if reference & LEAF == 0 {
                    stack[depth] = reference;
                    depth += 1;
                    continue;
                }
                let pack = &self.packs[(reference & !LEAF) as usize];
                let (mask, t, u, v) = intersect_pack(pack, &prepared, ray.t_max);
                for lane in lanes_of(mask) {
                    let (hit, is_opaque) = hit_in(pack, lane, [t[lane], u[lane], v[lane]]);
                    if is_opaque || accept(&hit) {
                        return true;
                    }
                }
            }
        }
        false
    }
}

/// The hit of one triangle of a pack, and whether the triangle is opaque.
#[inline(always)]
fn hit_in(pack: &Pack, lane: usize, [t, u, v]: [f32; 3]) -> (RayHit, bool) {
    let id = pack.id[lane];
    (RayHit { t, barycentrics: [u, v], triangle: id & !OPAQUE }, id & OPAQUE != 0)
}

/// Positions of the set bits.
#[inline(always)]
fn lanes_of(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            lane
        })
    })
}

#[inline(always)]
fn mask_of(bits: &[bool; WIDTH]) -> u32 {
    let mut mask = 0;
    for (lane, &bit) in bits.iter().enumerate() {
        mask |= u32::from(bit) << lane;
    }
    mask
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Which children the ray enters before `t_max`, and where.
#[inline(always)]
fn intersect_node(node: &Node, ray: &Prepared, t_max: f32) -> (u32, Lanes) {
    let mut enter = [0.0f32; WIDTH];
    let mut leave = [t_max; WIDTH];
    for axis in 0..3 {
        let near = &node.planes[axis][ray.near[axis]];
        let far = &node.planes[axis][1 - ray.near[axis]];
        let (origin, inverse) = (ray.origin[axis], ray.inverse[axis]);
        for lane in 0..WIDTH {
            enter[lane] = max((near[lane] - origin) * inverse, enter[lane]);
            // Two roundings of the far side, so that a grazed box is never missed.
            leave[lane] = min((far[lane] - origin) * inverse * 1.000_000_4, leave[lane]);
        }
    }
    let mut hit = [false; WIDTH];
    for lane in 0..WIDTH {
        hit[lane] = enter[lane] <= leave[lane];
    }
    (mask_of(&hit), enter)
}

/// Which triangles the ray meets in 0 < t < `t_max`, with distances and barycentrics.
///
/// Source: `[MoellerTrumbore97]`, edges stored.
#[inline(always)]
fn intersect_pack(pack: &Pack, ray: &Prepared, t_max: f32) -> (u32, Lanes, Lanes, Lanes) {
    let [ox, oy, oz] = ray.origin;
    let [dx, dy, dz] = ray.direction;
    let (mut t, mut u, mut v) = ([0.0; WIDTH], [0.0; WIDTH], [0.0; WIDTH]);
    let mut hit = [false; WIDTH];
    for i in 0..WIDTH {
        let (e1x, e1y, e1z) = (pack.edge1[0][i], pack.edge1[1][i], pack.edge1[2][i]);
        let (e2x, e2y, e2z) = (pack.edge2[0][i], pack.edge2[1][i], pack.edge2[2][i]);
        // p = direction × edge2; determinant = edge1 · p
        let (px, py, pz) = (dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x);
        let inverse = 1.0 / (e1x * px + e1y * py + e1z * pz);
        let (sx, sy, sz) = (ox - pack.corner[0][i], oy - pack.corner[1][i], oz - pack.corner[2][i]);
        u[i] = (sx * px + sy * py + sz * pz) * inverse;
        let (qx, qy, qz) = (sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x);
        v[i] = (dx * qx + dy * qy + dz * qz) * inverse;
        t[i] = (e2x * qx + e2y * qy + e2z * qz) * inverse;
        // Comparisons with NaN (a determinant of zero) are false.
        hit[i] = (u[i] >= -EDGE_SLACK)
            & (v[i] >= -EDGE_SLACK)
            & (u[i] + v[i] <= 1.0 + EDGE_SLACK)
            & (t[i] > 0.0)
            & (t[i] < t_max)
            & (pack.id[i] != NO_TRIANGLE);
    }
    (mask_of(&hit), t, u, v)
}

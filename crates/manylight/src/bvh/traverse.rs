//! Traversal: one node at a time, eight boxes at once.
//!
//! The bodies are written once over [`Vector`] and compiled twice on x86-64: for the baseline and
//! for AVX2, chosen when a ray starts. No fused multiply-add is used, so both give the same bits.

#[cfg(target_arch = "x86_64")]
use super::lanes::{Avx, Avx2};
use super::lanes::{Plain, Vector};
use super::pack::{LEAF, Node};
use super::{MAX_DEPTH, WIDTH};
use glam::Vec3;
use std::mem::MaybeUninit;

/// A half-open segment `origin + t·direction`, 0 < t < t_max; it meets nothing if its origin or
/// direction is not finite.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Start.
    pub origin: Vec3,
    /// Need not be unit.
    pub direction: Vec3,
    /// End, in units of `direction`.
    pub t_max: f32,
}

impl Ray {
    /// Whether it has a place: NaN would enter the slots of a node that are empty.
    #[inline(always)]
    fn is_finite(&self) -> bool {
        self.origin.is_finite() && self.direction.is_finite()
    }
}

/// A ray in all lanes.
pub(super) struct Prepared<V: Vector> {
    pub lanes: V::Found,
    pub origin: [V; 3],
    pub direction: [V; 3],
    inverse: [V; 3],
    /// Index of the near plane per axis.
    near: [usize; 3],
}

impl<V: Vector> Prepared<V> {
    #[inline(always)]
    fn new(lanes: V::Found, ray: &Ray) -> Self {
        let inverse = ray.direction.to_array().map(|d| {
            // A zero component must not make 0·∞ = NaN where the origin lies on a plane.
            1.0 / if d.abs() < 1e-30 { 1e-30f32.copysign(d) } else { d }
        });
        let near = inverse.map(|i| usize::from(i < 0.0));
        let splat =
            |[x, y, z]: [f32; 3]| [V::splat(lanes, x), V::splat(lanes, y), V::splat(lanes, z)];
        let [origin, direction] = [ray.origin.to_array(), ray.direction.to_array()];
        Self {
            lanes,
            origin: splat(origin),
            direction: splat(direction),
            inverse: splat(inverse),
            near,
        }
    }
}

/// What the traversal meets below the nodes.
pub(super) trait Leaves {
    /// Meets one leaf and may shorten the ray; true ends the walk.
    fn meet<V: Vector>(&mut self, leaf: usize, ray: &Prepared<V>, t_max: &mut f32) -> bool;
}

/// Visits the leaves that the ray reaches, nearer children of a node first.
#[inline]
pub(super) fn visit_near(nodes: &[Node], ray: &Ray, leaves: &mut impl Leaves) {
    if !ray.is_finite() {
        return;
    }
    #[cfg(target_arch = "x86_64")]
    if let Some(found) = Avx2::find() {
        // SAFETY: the processor has AVX2.
        return unsafe { visit_near_avx2(found, nodes, ray, leaves) };
    }
    visit_near_lanes::<Plain>((), nodes, ray, leaves);
}

/// Visits the leaves along a ray in the order of the slots; whether one ended the walk.
#[inline]
pub(super) fn visit_any(nodes: &[Node], ray: &Ray, leaves: &mut impl Leaves) -> bool {
    if !ray.is_finite() {
        return false;
    }
    #[cfg(target_arch = "x86_64")]
    if let Some(found) = Avx2::find() {
        // SAFETY: the processor has AVX2.
        return unsafe { visit_any_avx2(found, nodes, ray, leaves) };
    }
    visit_any_lanes::<Plain>((), nodes, ray, leaves)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn visit_near_avx2(found: Avx2, nodes: &[Node], ray: &Ray, leaves: &mut impl Leaves) {
    visit_near_lanes::<Avx>(found, nodes, ray, leaves);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn visit_any_avx2(found: Avx2, nodes: &[Node], ray: &Ray, leaves: &mut impl Leaves) -> bool {
    visit_any_lanes::<Avx>(found, nodes, ray, leaves)
}

#[inline(always)]
pub(super) fn visit_near_lanes<V: Vector>(
    lanes: V::Found,
    nodes: &[Node],
    ray: &Ray,
    leaves: &mut impl Leaves,
) {
    let prepared = Prepared::<V>::new(lanes, ray);
    let mut t_max = ray.t_max;
    let mut stack = Stack::<(u32, f32), NEAR_STACK>::new();
    stack.push((0, 0.0));
    while let Some((reference, t_near)) = stack.pop() {
        // What lies at the same distance may come earlier in the builder's list.
        if t_near > t_max {
            continue;
        }
        if reference & LEAF != 0 {
            if leaves.meet((reference & !LEAF) as usize, &prepared, &mut t_max) {
                return;
            }
            continue;
        }
        let node = &nodes[reference as usize];
        let (mask, t_near) = intersect_node(node, &prepared, t_max);
        let t_near = t_near.to_lanes();
        // Far to near, by insertion.
        let mut sorted = [(0, 0.0); WIDTH];
        let mut count = 0;
        for lane in lanes_of(mask) {
            let entry = (node.children[lane], t_near[lane]);
            let mut i = count;
            while i > 0 && sorted[i - 1].1 < entry.1 {
                sorted[i] = sorted[i - 1];
                i -= 1;
            }
            sorted[i] = entry;
            count += 1;
        }
        sorted[..count].iter().for_each(|&entry| stack.push(entry));
    }
}

#[inline(always)]
pub(super) fn visit_any_lanes<V: Vector>(
    lanes: V::Found,
    nodes: &[Node],
    ray: &Ray,
    leaves: &mut impl Leaves,
) -> bool {
    let prepared = Prepared::<V>::new(lanes, ray);
    let mut t_max = ray.t_max;
    // Nodes on the way down with slots that are still to be visited.
    let mut stack = Stack::<(u32, u32), MAX_DEPTH>::new();
    let mut index = 0;
    let (mut slots, _) = intersect_node(&nodes[0], &prepared, t_max);
    loop {
        if slots == 0 {
            let Some(above) = stack.pop() else { return false };
            (index, slots) = above;
        }
        let reference = nodes[index as usize].children[slots.trailing_zeros() as usize % WIDTH];
        slots &= slots - 1;
        if reference & LEAF != 0 {
            if leaves.meet((reference & !LEAF) as usize, &prepared, &mut t_max) {
                return true;
            }
            continue;
        }
        if slots != 0 {
            stack.push((index, slots));
        }
        index = reference;
        (slots, _) = intersect_node(&nodes[index as usize], &prepared, t_max);
    }
}

/// Room for the siblings of every level, and the last node's children.
const NEAR_STACK: usize = MAX_DEPTH * (WIDTH - 1) + WIDTH;

/// A stack whose room is not cleared: that would take as long as a visit of several nodes.
struct Stack<T, const N: usize> {
    entries: [MaybeUninit<T>; N],
    count: usize,
}

impl<T: Copy, const N: usize> Stack<T, N> {
    #[inline(always)]
    fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; N], count: 0 }
    }

    #[inline(always)]
    fn push(&mut self, entry: T) {
        self.entries[self.count].write(entry);
        self.count += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<T> {
        self.count = self.count.checked_sub(1)?;
        // SAFETY: `push` has written all entries below the count.
        Some(unsafe { self.entries[self.count].assume_init() })
    }
}

/// Positions of the set bits.
#[inline(always)]
pub(super) fn lanes_of(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            lane % WIDTH
        })
    })
}

/// Which children the ray enters before `t_max`, and where.
#[inline(always)]
fn intersect_node<V: Vector>(node: &Node, ray: &Prepared<V>, t_max: f32) -> (u32, V) {
    let (x, y, z) = (slabs(node, ray, 0), slabs(node, ray, 1), slabs(node, ray, 2));
    let enter = x.0.max(y.0).max(z.0.max(V::splat(ray.lanes, 0.0)));
    // Two roundings of the far side, so that a grazed box is never missed.
    let leave = x.1.min(y.1).min(z.1) * V::splat(ray.lanes, 1.000_000_4);
    (enter.le(leave.min(V::splat(ray.lanes, t_max))), enter)
}

/// Where the ray enters and leaves the slabs of one axis.
#[inline(always)]
fn slabs<V: Vector>(node: &Node, ray: &Prepared<V>, axis: usize) -> (V, V) {
    let (origin, inverse) = (ray.origin[axis], ray.inverse[axis]);
    let near = V::load(ray.lanes, &node.planes[axis][ray.near[axis]]);
    let far = V::load(ray.lanes, &node.planes[axis][1 - ray.near[axis]]);
    ((near - origin) * inverse, (far - origin) * inverse)
}

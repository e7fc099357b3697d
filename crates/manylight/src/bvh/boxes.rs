//! Rays against boxes, as those of instances.

use super::lanes::Vector;
use super::pack::Node;
use super::traverse::{Leaves, Prepared, Ray, visit_any, visit_near};

/// A hierarchy over boxes that are known by their position in the builder's list.
#[derive(Debug)]
pub struct BoxTree {
    pub(super) nodes: Vec<Node>,
    /// Leaf → position in the builder's list; a leaf holds exactly one.
    pub(super) items: Vec<u32>,
}

impl BoxTree {
    /// Visits the boxes along a ray up to where `meet` ends it, nearer children of a node first.
    ///
    /// `meet` is asked with a box and the ray's present end, and returns its new end.
    #[inline]
    pub fn visit_near(&self, ray: &Ray, meet: impl FnMut(u32, f32) -> f32) {
        visit_near(&self.nodes, ray, &mut Nearer { items: &self.items, meet });
    }

    /// Whether `stops` says so of any box along a ray.
    #[inline]
    pub fn visit_any(&self, ray: &Ray, stops: impl FnMut(u32) -> bool) -> bool {
        visit_any(&self.nodes, ray, &mut Any { items: &self.items, stops })
    }
}

struct Nearer<'a, F> {
    items: &'a [u32],
    meet: F,
}

impl<F: FnMut(u32, f32) -> f32> Leaves for Nearer<'_, F> {
    #[inline(always)]
    fn meet<V: Vector>(&mut self, leaf: usize, _: &Prepared<V>, t_max: &mut f32) -> bool {
        *t_max = (self.meet)(self.items[leaf], *t_max);
        false
    }
}

struct Any<'a, F> {
    items: &'a [u32],
    stops: F,
}

impl<F: FnMut(u32) -> bool> Leaves for Any<'_, F> {
    #[inline(always)]
    fn meet<V: Vector>(&mut self, leaf: usize, _: &Prepared<V>, _: &mut f32) -> bool {
        (self.stops)(self.items[leaf])
    }
}

//! Rays against triangle packs: closest hit and any hit.

use super::Bvh;
use super::lanes::Vector;
use super::pack::{Lanes, OPAQUE, Pack};
use super::traverse::{Leaves, Prepared, Ray, lanes_of, visit_any, visit_near};

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

/// Lets barycentrics pass an edge by this, so that no ray slips between two triangles.
pub(super) const EDGE_SLACK: f32 = 1e-6;

impl Bvh {
    /// The nearest hit that `accept` agrees to.
    ///
    /// `accept` is asked only about triangles that are not opaque.
    #[inline]
    pub fn closest(&self, ray: &Ray, accept: impl FnMut(&RayHit) -> bool) -> Option<RayHit> {
        let mut hits = Hits::<_, false> { packs: &self.packs, accept, nearest: None };
        visit_near(&self.nodes, ray, &mut hits);
        hits.nearest
    }

    /// Whether any triangle that `accept` agrees to stops the ray.
    ///
    /// `accept` is asked only about triangles that are not opaque.
    #[inline]
    pub fn occluded(&self, ray: &Ray, accept: impl FnMut(&RayHit) -> bool) -> bool {
        let mut hits = Hits::<_, true> { packs: &self.packs, accept, nearest: None };
        visit_any(&self.nodes, ray, &mut hits)
    }
}

/// Meets triangles until the nearest is found, or `ANY`.
pub(super) struct Hits<'a, F, const ANY: bool> {
    pub packs: &'a [Pack],
    pub accept: F,
    pub nearest: Option<RayHit>,
}

impl<F: FnMut(&RayHit) -> bool, const ANY: bool> Leaves for Hits<'_, F, ANY> {
    #[inline(always)]
    fn meet<V: Vector>(&mut self, leaf: usize, ray: &Prepared<V>, t_max: &mut f32) -> bool {
        let pack = &self.packs[leaf];
        let (mask, values) = intersect_pack::<_, ANY>(pack, ray, *t_max);
        if mask == 0 {
            return false;
        }
        if ANY && mask & opaque_lanes(pack) != 0 {
            return true;
        }
        let values = [values[0].to_lanes(), values[1].to_lanes(), values[2].to_lanes()];
        for lane in lanes_of(mask) {
            let hit = hit_in(pack, lane, &values);
            // Of any opaque one it is known by now.
            let is_opaque = !ANY && pack.id[lane] & OPAQUE != 0;
            if self.is_nearer(&hit, *t_max) && (is_opaque || (self.accept)(&hit)) {
                if ANY {
                    return true;
                }
                *t_max = hit.t;
                self.nearest = Some(hit);
            }
        }
        false
    }
}

impl<F, const ANY: bool> Hits<'_, F, ANY> {
    /// Whether a hit takes the place of the nearest one. Of two at the same distance, as in
    /// triangles that lie in one another, that is the one earlier in the builder's list: the order
    /// of the visits decides nothing.
    #[inline(always)]
    fn is_nearer(&self, hit: &RayHit, t_max: f32) -> bool {
        let is_tied = || self.nearest.is_some_and(|nearest| hit.triangle < nearest.triangle);
        hit.t < t_max || (!ANY && hit.t == t_max && is_tied())
    }
}

/// Bits of the lanes with an opaque triangle, and of those with none.
#[inline(always)]
fn opaque_lanes(pack: &Pack) -> u32 {
    pack.id.iter().enumerate().fold(0, |mask, (lane, id)| mask | ((id / OPAQUE) << lane))
}

#[inline(always)]
fn hit_in(pack: &Pack, lane: usize, [t, u, v]: &[Lanes; 3]) -> RayHit {
    let triangle = pack.id[lane] & !OPAQUE;
    RayHit { t: t[lane], barycentrics: [u[lane], v[lane]], triangle }
}

/// Which triangles the ray meets in 0 < t < `t_max`, with distances and barycentrics; unless `ANY`
/// will do, those at the very end too, which may be tied with the nearest.
///
/// Source: `[MoellerTrumbore97]`, edges stored.
#[inline(always)]
fn intersect_pack<V: Vector, const ANY: bool>(
    pack: &Pack,
    ray: &Prepared<V>,
    t_max: f32,
) -> (u32, [V; 3]) {
    let lanes = ray.lanes;
    let ([ox, oy, oz], [dx, dy, dz]) = (ray.origin, ray.direction);
    let [ax, ay, az] = load::<V>(lanes, &pack.corner);
    let [e1x, e1y, e1z] = load::<V>(lanes, &pack.edge1);
    let [e2x, e2y, e2z] = load::<V>(lanes, &pack.edge2);
    // p = direction × edge2; determinant = edge1 · p
    let (px, py, pz) = (dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x);
    let inverse = V::splat(lanes, 1.0) / (e1x * px + e1y * py + e1z * pz);
    let (sx, sy, sz) = (ox - ax, oy - ay, oz - az);
    let u = (sx * px + sy * py + sz * pz) * inverse;
    let (qx, qy, qz) = (sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x);
    let v = (dx * qx + dy * qy + dz * qz) * inverse;
    let t = (e2x * qx + e2y * qy + e2z * qz) * inverse;
    let end = V::splat(lanes, t_max);
    let is_before = if ANY { t.lt(end) } else { t.le(end) };
    // Comparisons with NaN are false: a determinant of zero, and lanes without a triangle.
    let mask = V::splat(lanes, -EDGE_SLACK).le(u)
        & V::splat(lanes, -EDGE_SLACK).le(v)
        & (u + v).le(V::splat(lanes, 1.0 + EDGE_SLACK))
        & V::splat(lanes, 0.0).lt(t)
        & is_before;
    (mask, [t, u, v])
}

#[inline(always)]
fn load<V: Vector>(lanes: V::Found, values: &[Lanes; 3]) -> [V; 3] {
    // No closures here: they would not be compiled for AVX2.
    [V::load(lanes, &values[0]), V::load(lanes, &values[1]), V::load(lanes, &values[2])]
}

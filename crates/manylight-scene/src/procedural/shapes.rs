//! Mesh primitives: mapped patches and solids, lathes, spheres.
//!
//! In: a map from unit parameters to space · Out: [`Mesh`] with smooth normals inside a patch and
//! creases between patches. Bodies made by one call are closed: shared edges have equal vertices.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use crate::Mesh;

/// Step of the finite differences that give normals, in parameter units.
const STEP: f32 = 1e-3;
/// Profile corners sharper than this (cosine) stay creases on a lathe.
const CREASE_COS: f32 = 0.7;

/// A mesh under construction.
#[derive(Default)]
pub(super) struct Shape {
    mesh: Mesh,
    tint: Option<Vec3>,
}

impl Shape {
    /// Vertex color of everything added from now on; white before the first call.
    pub(super) fn tint(&mut self, color: Vec3) -> &mut Self {
        self.tint = Some(color);
        self
    }

    /// A grid of nu × nv quads over (u, v) in 0…1, facing ∂f/∂u × ∂f/∂v.
    pub(super) fn patch(&mut self, nu: usize, nv: usize, f: impl Fn(f32, f32) -> Vec3) {
        let first = self.mesh.positions.len() as u32;
        for j in 0..=nv {
            for i in 0..=nu {
                let (u, v) = (i as f32 / nu as f32, j as f32 / nv as f32);
                self.vertex(f(u, v), patch_normal(&f, u, v));
            }
        }
        let row = nu as u32 + 1;
        for j in 0..nv as u32 {
            for i in 0..nu as u32 {
                let a = first + j * row + i;
                self.triangle([a, a + 1, a + row + 1]);
                self.triangle([a, a + row + 1, a + row]);
            }
        }
    }

    /// The unit cube, its faces cut into `n` parts per axis, mapped by `f` (which must keep
    /// orientation). Closed.
    pub(super) fn solid(&mut self, n: [usize; 3], f: impl Fn(Vec3) -> Vec3) {
        for axis in 0..3 {
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            let at = |x: f32, y: f32, z: f32| {
                let mut p = [0.0; 3];
                p[axis] = x;
                p[b] = y;
                p[c] = z;
                f(p.into())
            };
            self.patch(n[b], n[c], |u, v| at(1.0, u, v));
            self.patch(n[c], n[b], |u, v| at(0.0, v, u));
        }
    }

    /// An axis-aligned box. Closed.
    pub(super) fn block(&mut self, min: Vec3, max: Vec3) {
        self.solid([1; 3], |p| min + (max - min) * p);
    }

    /// A profile of (radius, height) turned about the Y axis in `n` steps; going up the profile
    /// the outside is away from the axis. Closed where the profile begins and ends at radius 0
    /// or is a loop.
    pub(super) fn lathe(&mut self, profile: &[[f32; 2]], n: usize) {
        let mut points: Vec<Vec2> = profile.iter().map(|&p| p.into()).collect();
        points.dedup_by(|b, a| a.distance(*b) < 1e-5);
        let facing: Vec<Vec2> =
            points.windows(2).map(|w| (w[1] - w[0]).normalize_or_zero()).collect();
        let facing: Vec<Vec2> = facing.iter().map(|d| Vec2::new(d.y, -d.x)).collect();
        // The normal of segment `of` at its border with segment `with`.
        let smooth = |of: usize, with: Option<usize>| match with.and_then(|i| facing.get(i)) {
            Some(&other) if other.dot(facing[of]) > CREASE_COS => (facing[of] + other).normalize(),
            _ => facing[of],
        };
        for i in 0..facing.len() {
            let ends =
                [(points[i], smooth(i, i.checked_sub(1))), (points[i + 1], smooth(i, Some(i + 1)))];
            let first = self.mesh.positions.len() as u32;
            for k in 0..=n {
                let (sin, cos) = turn(k as f32 / n as f32);
                for (p, facing) in ends {
                    let spun = |q: Vec2| Vec3::new(q.x * cos, q.y, q.x * sin);
                    self.vertex(spun(p), spun(facing));
                }
            }
            for k in 0..n as u32 {
                let a = first + 2 * k;
                self.triangle([a, a + 1, a + 3]);
                self.triangle([a, a + 3, a + 2]);
            }
        }
    }

    /// A unit icosahedron, each triangle split `levels` times into four, pushed onto the unit
    /// sphere and mapped by `f`. Closed; normals are those of the faces averaged by `f`'s sphere.
    pub(super) fn sphere(&mut self, levels: u32, f: impl Fn(Vec3) -> Vec3) {
        let g = (1.0 + 5f32.sqrt()) / 2.0;
        let corners = [
            [-1.0, g, 0.0],
            [1.0, g, 0.0],
            [-1.0, -g, 0.0],
            [1.0, -g, 0.0],
            [0.0, -1.0, g],
            [0.0, 1.0, g],
            [0.0, -1.0, -g],
            [0.0, 1.0, -g],
            [g, 0.0, -1.0],
            [g, 0.0, 1.0],
            [-g, 0.0, -1.0],
            [-g, 0.0, 1.0],
        ]
        .map(|c| Vec3::from(c).normalize());
        // Every face is three corners at mutual distance of one edge; orientation by its center.
        let edge = corners[0].distance(corners[1]) * 1.01;
        for a in 0..12 {
            for b in a + 1..12 {
                for c in b + 1..12 {
                    let t = [corners[a], corners[b], corners[c]];
                    if t[0].distance(t[1]) < edge
                        && t[1].distance(t[2]) < edge
                        && t[2].distance(t[0]) < edge
                    {
                        let outward = (t[1] - t[0]).cross(t[2] - t[0]).dot(t[0]) > 0.0;
                        let t = if outward { t } else { [t[0], t[2], t[1]] };
                        self.sphere_part(t, levels, &f);
                    }
                }
            }
        }
    }

    fn sphere_part(&mut self, t: [Vec3; 3], levels: u32, f: &impl Fn(Vec3) -> Vec3) {
        let [a, b, c] = t;
        if levels > 0 {
            let middle = |p: Vec3, q: Vec3| (p + q).normalize();
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                self.sphere_part(part, levels - 1, f);
            }
            return;
        }
        let first = self.mesh.positions.len() as u32;
        for p in t {
            // Two tangents on the sphere, carried by the map, span the mapped tangent plane.
            let (x, y) = p.any_orthonormal_pair();
            let du = f((p + x * STEP).normalize()) - f((p - x * STEP).normalize());
            let dv = f((p + y * STEP).normalize()) - f((p - y * STEP).normalize());
            let n = du.cross(dv).try_normalize().unwrap_or(p);
            let flip = if x.cross(y).dot(p) < 0.0 { -1.0 } else { 1.0 };
            self.vertex(f(p), n * flip);
        }
        self.triangle([first, first + 1, first + 2]);
    }

    /// Swaps the sides of all triangles.
    pub(super) fn turn_inside_out(&mut self) {
        self.mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        self.mesh.normals.iter_mut().for_each(|n| *n = -*n);
    }

    /// Drops vertex normals: every triangle is shaded flat.
    pub(super) fn flat_normals(&mut self) {
        self.mesh.normals.clear();
    }

    /// Texture coordinates from x and z, one unit per `metres`.
    pub(super) fn map_from_above(&mut self, metres: f32) {
        self.mesh.uvs[0] =
            self.mesh.positions.iter().map(|p| Vec2::new(p.x, p.z) / metres).collect();
    }

    pub(super) fn into_mesh(self) -> Mesh {
        self.mesh
    }

    fn vertex(&mut self, position: Vec3, normal: Vec3) {
        self.mesh.positions.push(position);
        self.mesh.normals.push(normal);
        self.mesh.colors.push(self.tint.unwrap_or(Vec3::ONE).extend(1.0));
    }

    /// Adds a triangle unless it has no area (as at the poles of a lathe).
    fn triangle(&mut self, t: [u32; 3]) {
        let [a, b, c] = t.map(|i| self.mesh.positions[i as usize]);
        if a != b && b != c && c != a && (b - a).cross(c - a).length_squared() > 1e-16 {
            self.mesh.triangles.push(t);
        }
    }
}

/// Sine and cosine of a share of the full turn; the end equals the beginning bit by bit.
pub(super) fn turn(share: f32) -> (f32, f32) {
    (share.fract() * TAU).sin_cos()
}

/// Unit normal of a patch, taken just inside where the patch is pinched to a point.
fn patch_normal(f: &impl Fn(f32, f32) -> Vec3, u: f32, v: f32) -> Vec3 {
    let at = |u: f32, v: f32| {
        let du = f((u + STEP).min(1.0), v) - f((u - STEP).max(0.0), v);
        let dv = f(u, (v + STEP).min(1.0)) - f(u, (v - STEP).max(0.0));
        let n = du.cross(dv);
        (n.length_squared() > 1e-6 * du.length_squared() * dv.length_squared())
            .then(|| n.try_normalize())
            .flatten()
    };
    at(u, v).or_else(|| at(u * 0.96 + 0.02, v * 0.96 + 0.02)).unwrap_or(Vec3::Y)
}

//! The stone parts of the atrium: columns, arches, vaults, balustrades, cornices.
//!
//! Each part is modelled at the origin: x along the facade, y up, +z away from the court.

use std::f32::consts::PI;

use glam::{Vec2, Vec3};

use super::hash01;
use super::shapes::{Shape, turn};

/// Distance of neighboring columns, metres.
pub(super) const BAY: f32 = 3.0;
/// Thickness of the arcade walls, metres.
pub(super) const WALL: f32 = 0.5;
/// Radius of every arch, metres.
pub(super) const ARCH_RADIUS: f32 = 1.18;
/// Stones of one arch.
const VOUSSOIRS: u32 = 13;
/// Height of the ring of stones, metres.
const RING: f32 = 0.30;

/// A round column of this height with a molded base and a flaring capital under a square slab.
///
/// `flutes` 0 gives a smooth shaft, otherwise that many shallow grooves.
pub(super) fn column(height: f32, radius: f32, flutes: u32) -> Shape {
    let mut shape = Shape::default();
    let (r, slab) = (radius, radius * 1.55);
    let centered =
        |half: f32, y: [f32; 2]| (Vec3::new(-half, y[0], -half), Vec3::new(half, y[1], half));
    // Plinth and slab.
    shape.tint(Vec3::splat(0.92));
    let (min, max) = centered(slab, [0.0, 0.14]);
    shape.block(min, max);
    let (min, max) = centered(slab, [height - 0.14, height]);
    shape.block(min, max);
    // Base: torus, hollow, torus.
    let mut base = vec![[0.0, 0.13], [r * 1.2, 0.13]];
    base.extend(arc([r * 1.25, 0.21], [0.08, 0.07], -0.5 * PI, 0.5 * PI, 8));
    base.extend(arc([r * 1.30, 0.315], [0.06, 0.035], -0.5 * PI, -1.5 * PI, 8));
    base.extend(arc([r * 1.13, 0.39], [0.05, 0.04], -0.5 * PI, 0.5 * PI, 8));
    base.push([0.0, 0.43]);
    shape.tint(Vec3::splat(0.97));
    shape.lathe(&base, 24);
    // Capital: two rings, then a bell.
    let bell = height - 0.13;
    let mut capital = vec![[0.0, bell - 0.48], [r * 0.86, bell - 0.48]];
    capital.extend(arc([r * 0.88, bell - 0.44], [0.04, 0.035], -0.5 * PI, 0.5 * PI, 6));
    for i in 0..=10 {
        let t = i as f32 / 10.0;
        let flare = 1.0 - (1.0 - t * t).sqrt();
        capital.push([r * (0.86 + 0.56 * flare), bell - 0.40 + 0.34 * t]);
    }
    capital.extend(arc([r * 1.42, bell - 0.03], [0.03, 0.03], -0.5 * PI, 0.5 * PI, 6));
    capital.push([0.0, bell]);
    shape.lathe(&capital, 24);
    leaves(&mut shape, r, bell - 0.40);
    shaft(&mut shape, [0.42, bell - 0.46], r, flutes);
    shape
}

/// The shaft: swells by a hundredth, narrows by a seventh.
fn shaft(shape: &mut Shape, y: [f32; 2], radius: f32, flutes: u32) {
    shape.tint(Vec3::new(1.0, 0.98, 0.95));
    let around = if flutes > 0 { flutes as usize * 4 } else { 24 };
    let surface = |t: f32, share: f32| {
        let taper = 1.0 - 0.14 * t * t + 0.03 * (PI * t).sin();
        let groove = match flutes {
            0 => 0.0,
            n => {
                0.06 * (share.fract() * n as f32 * PI).sin().abs()
                    * (PI * t).sin().max(0.0).powf(0.15)
            }
        };
        let (sin, cos) = turn(share);
        let r = radius * (taper - groove);
        Vec3::new(r * cos, y[0] + (y[1] - y[0]) * t, r * sin)
    };
    shape.patch(10, around, surface);
    // Lids, hidden in base and capital, keep the shaft closed.
    let lid = |t: f32, flip: bool| {
        move |s: f32, share: f32| {
            let s = if flip { 1.0 - s } else { s };
            let p = surface(t, share);
            Vec3::new(p.x * s, p.y, p.z * s)
        }
    };
    shape.patch(1, around, lid(0.0, false));
    shape.patch(1, around, lid(1.0, true));
}

/// Eight curling leaves around the bell of a capital.
fn leaves(shape: &mut Shape, radius: f32, y: f32) {
    shape.tint(Vec3::splat(0.90));
    for k in 0..8 {
        let (sin, cos) = turn((k as f32 + 0.5) / 8.0);
        let (out, along) = (Vec3::new(cos, 0.0, sin), Vec3::new(sin, 0.0, -cos));
        shape.solid([4, 1, 6], |p| {
            let t = p.z;
            let width = radius * 0.58 * (0.55 + 0.75 * t - 1.1 * t * t * t).max(0.12);
            let curl = radius * (0.84 + 0.30 * t * t + 0.22 * t.powi(6));
            let bulge = 0.05 * radius * (PI * p.x).sin() - 0.03 * radius;
            let rise = 0.29 * t - 0.05 * t.powi(6);
            let r = curl + bulge + radius * 0.09 * (1.0 - p.y);
            out * r + along * (width * (p.x - 0.5)) + Vec3::Y * (y + rise)
        });
    }
}

/// One bay of an arcade wall above its columns, from the springing (y = 0) to `top`, with the
/// ring of stones around the opening. Spans x in ±BAY/2 and z in ±WALL/2.
pub(super) fn arch(top: f32) -> Shape {
    let mut shape = Shape::default();
    // The wall: radial lines from inside the ring to the bay's outline.
    let inner = ARCH_RADIUS + 0.02;
    shape.tint(Vec3::new(0.96, 0.94, 0.92));
    let corner = (top / (0.5 * BAY)).atan();
    shape.solid([2, 1, 32], |p| {
        // Parameter lines meet the outline's two corners at 1/4 and 3/4.
        let angle = match p.z {
            t if t <= 0.25 => 4.0 * t * corner,
            t if t < 0.75 => corner + (t - 0.25) * 2.0 * (PI - 2.0 * corner),
            t => PI - (1.0 - t) * 4.0 * corner,
        };
        let ray = Vec2::from_angle(angle);
        let ray = if p.z == 1.0 { Vec2::NEG_X } else { ray };
        let reach = (0.5 * BAY / ray.x.abs().max(1e-6)).min(top / ray.y.abs().max(1e-6));
        let q = ray * (inner + (reach - inner) * p.x);
        Vec3::new(q.x, q.y.max(0.0), WALL * (0.5 - p.y))
    });
    // The ring: one block per stone, projecting on both faces, with open joints.
    let step = PI / VOUSSOIRS as f32;
    for k in 0..VOUSSOIRS {
        let key = k == VOUSSOIRS / 2;
        shape.tint(Vec3::splat(0.82 + 0.18 * hash01(40 + k)));
        let (proud, outer) = if key { (0.075, RING + 0.05) } else { (0.045, RING) };
        let depth = 0.5 * WALL + proud;
        shape.solid([2, 2, 4], |p| {
            // The outer edge is rounded off by 12 mm toward both faces.
            let edge = (2.0 * p.y - 1.0).abs().powi(8) * 0.012;
            let angle = step * (k as f32 + 0.02 + 0.96 * p.z);
            let r = ARCH_RADIUS + (outer - edge) * p.x;
            let (sin, cos) = angle.sin_cos();
            Vec3::new(r * cos, r * sin, depth * (1.0 - 2.0 * p.y))
        });
    }
    shape
}

/// A square pier with base and cap moldings, `half` metres from its axis to its faces.
pub(super) fn pier(height: f32, half: f32) -> Shape {
    let mut shape = Shape::default();
    shape.tint(Vec3::new(0.95, 0.93, 0.90));
    for (proud, y) in [
        (0.06, [0.0, 0.22]),
        (0.03, [0.22, 0.30]),
        (0.0, [0.30, height - 0.34]),
        (0.03, [height - 0.34, height - 0.26]),
        (0.06, [height - 0.26, height]),
    ] {
        let half = half + proud;
        shape.block(Vec3::new(-half, y[0], -half), Vec3::new(half, y[1], half));
    }
    shape
}

/// Height above the springing of a flattened arch of rise 1 at distance q in −1…1.
fn flat_arch(q: f32) -> f32 {
    ((1.0 - 0.96 * q * q).max(0.0).sqrt() - 0.2) / 0.8
}

/// The underside of a groin vault over x in ±half.x, z in ±half.y; rises from 0 to `rise`.
pub(super) fn vault(half: Vec2, rise: f32) -> Shape {
    let mut shape = Shape::default();
    // Four webs; s runs from the crown to a side, t along the side.
    for (along_x, sign) in [(true, 1.0), (true, -1.0), (false, 1.0), (false, -1.0)] {
        shape.tint(Vec3::splat(if along_x { 0.98 } else { 0.93 }));
        let web = |s: f32, t: f32| {
            let across = s * (2.0 * t - 1.0);
            let (x, z) =
                if along_x { (s * sign, -across * sign) } else { (across * sign, s * sign) };
            Vec3::new(half.x * x, rise * flat_arch(across), half.y * z)
        };
        // Facing down: ∂s × ∂t points down for (out, clockwise seen from above) in both cases.
        shape.patch(10, 14, |s, t| web(s, 1.0 - t));
    }
    shape
}

/// A rib under the seam of two vaults, spanning z in ±half, thickness to both sides of x = 0.
pub(super) fn rib(half: f32, rise: f32) -> Shape {
    let mut shape = Shape::default();
    shape.tint(Vec3::splat(0.88));
    shape.solid([2, 2, 20], |p| {
        let q = 2.0 * p.z - 1.0;
        let y = rise * flat_arch(q) - 0.16 + 0.22 * p.y;
        let narrow = 0.15 - 0.05 * (1.0 - p.y);
        Vec3::new(narrow * (2.0 * p.x - 1.0), y, half * q)
    });
    shape
}

/// A turned baluster, 0.70 m high.
pub(super) fn baluster() -> Shape {
    let mut shape = Shape::default();
    shape.block(Vec3::new(-0.075, 0.0, -0.075), Vec3::new(0.075, 0.07, 0.075));
    shape.block(Vec3::new(-0.075, 0.64, -0.075), Vec3::new(0.075, 0.70, 0.075));
    let mut profile = vec![[0.0, 0.06], [0.045, 0.06]];
    for i in 0..=10 {
        let t = i as f32 / 10.0;
        let belly = (PI * (t * 1.05).min(1.0).powf(0.62)).sin().max(0.0);
        profile.push([0.034 + 0.046 * belly, 0.08 + 0.52 * t]);
    }
    profile.extend([[0.055, 0.61], [0.055, 0.65], [0.0, 0.65]]);
    shape.lathe(&profile, 12);
    shape
}

/// A molding that follows the facade for one bay and projects toward the court (−z), from the
/// wall's middle; with a row of blocks under its shelf.
pub(super) fn cornice() -> Shape {
    let mut shape = Shape::default();
    shape.tint(Vec3::new(0.98, 0.97, 0.94));
    // Outline in (projection, height), as a fan of slabs: each step closed by itself.
    for (reach, y) in [
        (0.32, [0.0, 0.06]),
        (0.36, [0.06, 0.11]),
        (0.50, [0.22, 0.30]),
        (0.54, [0.30, 0.33]),
        (0.58, [0.33, 0.40]),
    ] {
        shape.block(Vec3::new(-0.5 * BAY, y[0], -reach), Vec3::new(0.5 * BAY, y[1], 0.2));
    }
    shape.block(Vec3::new(-0.5 * BAY, 0.11, -0.34), Vec3::new(0.5 * BAY, 0.22, 0.2));
    for k in 0..12 {
        let x = ((k as f32 + 0.5) / 12.0 - 0.5) * BAY;
        shape.block(Vec3::new(x - 0.06, 0.12, -0.46), Vec3::new(x + 0.06, 0.221, -0.30));
    }
    shape
}

/// A paneled door in its stone frame, 1.3 × 2.5 m, standing before a wall at z = 0, facing −z.
pub(super) fn door_frame() -> Shape {
    let mut shape = Shape::default();
    shape.tint(Vec3::splat(0.95));
    for side in [-1.0, 1.0] {
        let x = side * 0.78;
        shape.block(Vec3::new(x - 0.13, 0.0, -0.14), Vec3::new(x + 0.13, 2.55, 0.1));
    }
    shape.block(Vec3::new(-0.98, 2.55, -0.17), Vec3::new(0.98, 2.82, 0.1));
    shape.block(Vec3::new(-1.06, 2.82, -0.22), Vec3::new(1.06, 2.92, 0.1));
    shape
}

/// The two leaves of the door, each with three raised panels.
pub(super) fn door() -> Shape {
    let mut shape = Shape::default();
    shape.tint(Vec3::splat(0.9));
    shape.block(Vec3::new(-0.66, 0.0, -0.04), Vec3::new(0.66, 2.56, 0.1));
    for k in 0..6u32 {
        let (x, y) = ((k % 2) as f32 * 0.64 - 0.32, (k / 2) as f32 * 0.82 + 0.46);
        shape.tint(Vec3::splat(0.85 + 0.15 * hash01(70 + k)));
        shape.solid([1; 3], |p| {
            // Narrower in front: a raised field with sloping edges.
            let shrink = 1.0 - 0.22 * (1.0 - p.z);
            let q = (p - 0.5) * Vec3::new(0.50 * shrink, 0.68 * shrink, 0.0);
            Vec3::new(x + q.x, y + q.y, -0.075 + 0.04 * p.z)
        });
    }
    shape
}

/// Points on an ellipse around a center (r, y), from one angle to another, both included.
pub(super) fn arc(
    center: [f32; 2],
    radii: [f32; 2],
    from: f32,
    to: f32,
    n: usize,
) -> impl Iterator<Item = [f32; 2]> {
    (0..=n).map(move |i| {
        let (sin, cos) = (from + (to - from) * i as f32 / n as f32).sin_cos();
        [center[0] + radii[0] * cos, center[1] + radii[1] * sin]
    })
}

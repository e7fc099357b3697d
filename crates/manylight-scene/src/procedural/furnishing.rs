//! What stands and hangs in the atrium: drapery, fountain, plants, floor.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::hash01;
use super::masonry::arc;
use super::shapes::{Shape, turn};
use crate::TextureImage;

/// A curtain 2.1 m wide, gathered at the top (y = 0) and tied back at x < 0; hangs 3.1 m down.
/// A single sheet: it blocks and reflects on both sides.
pub(super) fn curtain() -> Shape {
    let mut shape = Shape::default();
    shape.patch(96, 40, |u, v| {
        let tie = (-((v - 0.62) / 0.22).powi(2)).exp();
        let width = 2.1 * (1.0 - 0.62 * tie - 0.25 * (v - 0.62).max(0.0));
        let x = -1.05 + width * u;
        let depth = 0.03 + 0.07 * v.sqrt() * (1.0 - 0.5 * tie);
        let folds = (u * 9.0 * TAU + 1.3 * (2.0 * v).sin()).sin()
            + 0.35 * (u * 21.0 * TAU + 4.0 * v).sin() * (1.0 - tie);
        let swag = 0.22 * (PI * u).sin() * (1.0 - v) * v;
        Vec3::new(x, -3.1 * v - swag, depth * folds)
    });
    shape
}

/// A banner 1.1 m wide and 2.4 m long with a pointed foot, stirred by a light wind (single sheet).
pub(super) fn banner() -> Shape {
    let mut shape = Shape::default();
    shape.patch(28, 48, |u, v| {
        let foot = 0.35 * v * (1.0 - (2.0 * u - 1.0).abs());
        let wave = (0.10 * v) * (3.0 * v + 2.0 * u).sin()
            + 0.035 * (0.3 + 0.7 * v) * (u * 3.5 * TAU + 2.0 * v).sin();
        Vec3::new(1.1 * (u - 0.5), -2.05 * v - foot, wave)
    });
    shape
}

/// A round bar along y, centered, with a knob at each end.
pub(super) fn rod(half: f32) -> Shape {
    let mut shape = Shape::default();
    shape.lathe(&[[0.0, -half], [0.016, -half], [0.016, half], [0.0, half]], 10);
    for end in [-half, half] {
        shape.sphere(1, |p| p * 0.035 + Vec3::Y * end);
    }
    shape
}

/// A fountain 4 m across: round steps, a basin, a stem, two bowls and a finial.
pub(super) fn fountain() -> Shape {
    let mut shape = Shape::default();
    shape.tint(Vec3::splat(0.86));
    for (r, y) in [(2.35, [-0.02, 0.12]), (2.10, [0.12, 0.24])] {
        shape.lathe(&[[0.0, y[0]], [r, y[0]], [r, y[1]], [0.0, y[1]]], 64);
    }
    // Basin: a wall of rich section around a floor at 0.30 m.
    shape.tint(Vec3::splat(0.97));
    let mut basin = vec![[0.0, 0.24], [1.72, 0.24], [1.72, 0.32]];
    basin.extend(arc([1.66, 0.50], [0.06, 0.16], -0.4 * PI, 0.4 * PI, 8));
    basin.extend(arc([1.70, 0.76], [0.12, 0.06], -0.5 * PI, 0.5 * PI, 8));
    basin.extend(arc([1.56, 0.76], [0.06, 0.06], 0.5 * PI, PI, 5));
    basin.extend([[1.50, 0.30], [0.0, 0.30]]);
    shape.lathe(&basin, 96);
    // Stem with a knot, then a wide and a narrow bowl.
    let mut stem = vec![[0.0, 0.28], [0.34, 0.28], [0.34, 0.42]];
    stem.extend(arc([0.20, 0.52], [0.12, 0.10], -0.5 * PI, 0.5 * PI, 8));
    stem.extend(arc([0.26, 0.85], [0.10, 0.20], -0.5 * PI, -1.5 * PI, 10));
    stem.extend([[0.20, 1.10], [0.12, 1.50], [0.10, 1.62], [0.0, 1.62]]);
    shape.lathe(&stem, 48);
    bowl(&mut shape, 0.95, 1.20, 0.34);
    let upper = [[0.0, 1.5], [0.09, 1.5], [0.06, 1.8], [0.11, 1.86], [0.06, 1.92], [0.05, 2.2]];
    shape.lathe(&[upper.as_slice(), &[[0.0, 2.2]]].concat(), 32);
    bowl(&mut shape, 0.48, 1.96, 0.20);
    shape.sphere(3, |p| Vec3::new(p.x * 0.1, p.y * 0.13 + 2.30, p.z * 0.1));
    shape
}

/// A shallow bowl with a scalloped rim: radius, height of its foot, depth.
fn bowl(shape: &mut Shape, radius: f32, y: f32, depth: f32) {
    let section = |s: f32, share: f32, thick: f32| {
        let lobes = 1.0 + 0.05 * s * (16.0 * PI * share.fract()).sin().abs();
        let (sin, cos) = turn(share);
        let r = radius * s * lobes;
        let rise = y + depth * s.powf(2.2) + thick * (1.0 - s * s * s * s);
        Vec3::new(r * cos, rise, r * sin)
    };
    // Outside below, inside above; both meet at the rim.
    shape.patch(14, 96, |s, share| section(s, share, 0.0));
    shape.patch(14, 96, |s, share| section(1.0 - s, share, 0.05));
}

/// The water surfaces of the fountain: disks with faint ripples.
pub(super) fn water() -> Shape {
    let mut shape = Shape::default();
    for (radius, y) in [(1.54, 0.66), (0.80, 1.44), (0.37, 2.09)] {
        shape.patch(16, 48, |s, share| {
            let (sin, cos) = turn(share);
            let r = radius * (1.0 - s);
            let ripple = 0.006 * (r * 26.0).sin() * (1.0 - r / radius);
            Vec3::new(r * cos, y + ripple, r * sin)
        });
    }
    shape
}

/// A terracotta pot 0.75 m high, filled with earth to 0.68 m.
pub(super) fn pot() -> Shape {
    let mut shape = Shape::default();
    let mut profile = vec![[0.0, 0.0], [0.24, 0.0], [0.26, 0.05]];
    profile.extend(arc([0.24, 0.36], [0.16, 0.30], -0.42 * PI, 0.36 * PI, 12));
    profile.extend(arc([0.37, 0.71], [0.05, 0.04], -0.5 * PI, 0.5 * PI, 6));
    profile.extend([[0.31, 0.74], [0.29, 0.68], [0.0, 0.68]]);
    shape.lathe(&profile, 36);
    shape
}

/// A bush of curved leaves (single sheets) around y = 1.1, of radius 0.5 m.
pub(super) fn bush() -> Shape {
    let mut shape = Shape::default();
    for k in 0..360u32 {
        let rnd = |dim: u32| hash01(k * 8 + dim + 5000);
        let green = 0.65 + 0.35 * rnd(0);
        shape.tint(Vec3::new(green * (0.7 + 0.3 * rnd(5)), green, green * 0.8));
        let (sin, cos) = turn(rnd(1));
        let up = 1.8 * rnd(2) - 0.8;
        let side = (1.0 - up * up).max(0.0).sqrt();
        let out = Vec3::new(side * cos, up, side * sin);
        let root = Vec3::new(0.0, 1.1, 0.0) + out * (0.16 + 0.26 * rnd(3).sqrt());
        let along = (out + Vec3::new(0.0, 0.7, 0.0)).normalize_or(Vec3::Y);
        let across = along.cross(Vec3::new(rnd(4) - 0.5, 0.2, rnd(6) - 0.5)).normalize_or(Vec3::X);
        let back = along.cross(across);
        let length = 0.16 + 0.08 * rnd(7);
        shape.patch(2, 4, |u, v| {
            let half = 0.042 * (PI * (0.06 + 0.9 * v)).sin();
            let droop = 0.35 * v * v;
            let crease = 0.3 * (2.0 * u - 1.0).abs();
            root + along * (length * v)
                + across * (half * (2.0 * u - 1.0))
                + back * (length * droop - half * crease)
        });
    }
    shape
}

/// Stone tiles with sloping edges over x in ±half.x, z in ±half.y; top at 0, joints 12 mm deep.
pub(super) fn tiles(half: Vec2, size: f32) -> Shape {
    let mut shape = Shape::default();
    let (nx, nz) = ((2.0 * half.x / size).round() as u32, (2.0 * half.y / size).round() as u32);
    for j in 0..nz {
        for i in 0..nx {
            let light = (i + j).is_multiple_of(2);
            let shade = 0.84 + 0.16 * hash01(i * 131 + j * 7919);
            let color = if light { Vec3::ONE } else { Vec3::new(0.62, 0.40, 0.32) };
            shape.tint(color * shade);
            let low = Vec2::new(i as f32, j as f32) * size - half;
            let lift = 0.004 * (hash01(i * 37 + j * 1009) - 0.5);
            tile(&mut shape, low, size, lift);
        }
    }
    shape
}

/// One tile: a top and four slopes that reach down to the neighbors' feet.
fn tile(shape: &mut Shape, low: Vec2, size: f32, lift: f32) {
    const BEVEL: f32 = 0.010;
    const DEPTH: f32 = 0.012;
    let corner = |x: f32, z: f32, inset: f32| {
        let inward = |t: f32| low + Vec2::splat(inset + t * (size - 2.0 * inset));
        Vec3::new(inward(x).x, if inset > 0.0 { lift } else { -DEPTH }, inward(z).y)
    };
    shape.patch(1, 1, |u, v| corner(v, u, BEVEL));
    // Around the top: each slope runs from foot to top along one side.
    let ring = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)];
    for side in ring.windows(2) {
        let at = |along: f32, inset: f32| {
            let [a, b] = [side[0], side[1]];
            corner(a.0 + (b.0 - a.0) * along, a.1 + (b.1 - a.1) * along, inset)
        };
        shape.patch(1, 1, |u, v| at(v, 0.0).lerp(at(v, BEVEL), u));
    }
}

/// A tileable picture of two-colored marble squares with veins, 128 × 128 texels, sRGB.
pub(super) fn marble() -> TextureImage {
    const SIZE: u32 = 128;
    let texel = |k: u32| {
        let (x, y) = ((k % SIZE) as f32 / SIZE as f32, (k / SIZE) as f32 / SIZE as f32);
        // Whole periods along x and y, so that the picture tiles.
        let warp = (TAU * 2.0 * y).sin() * 0.9 + (TAU * (3.0 * x + y)).sin() * 0.5;
        let vein = (TAU * (x + 2.0 * y) + 2.2 * warp).sin().abs().powf(0.35);
        let light = ((k % SIZE) / (SIZE / 2) + (k / SIZE) / (SIZE / 2)).is_multiple_of(2);
        let joint = [x, y].iter().any(|t| (t * 2.0).fract() < 0.02);
        let base = if light { [226.0, 214.0, 196.0] } else { [148.0, 86.0, 70.0] };
        let dim = if joint { 0.6 } else { 0.86 + 0.14 * vein };
        let [r, g, b] = base.map(|c: f32| (c * dim) as u8);
        [r, g, b, 255]
    };
    let texels = (0..SIZE * SIZE).map(texel).collect();
    TextureImage { name: "marble".to_owned(), width: SIZE, height: SIZE, texels }
}

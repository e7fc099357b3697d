//! A hall lit by thousands of small colored lamps on sagging strings, and by nothing else.

use glam::{Affine3A, Vec3};

use super::shapes::Shape;
use super::{Assembly, View, hash01};
use crate::{Material, Shot};

/// Strings of lamps along the hall.
const STRINGS: u32 = 32;
/// Lamps on each string.
const LAMPS_PER_STRING: u32 = 128;
/// Radius of a lamp, metres.
const LAMP_RADIUS: f32 = 0.02;
/// Half width, height and half length of the hall, metres.
const HALL: Vec3 = Vec3::new(4.0, 4.0, 8.0);
/// Emitted radiance of each kind of lamp, W·m⁻²·sr⁻¹.
const RADIANCES: [[f32; 3]; 8] = [
    [90.0, 60.0, 28.0],
    [80.0, 16.0, 10.0],
    [12.0, 60.0, 20.0],
    [14.0, 26.0, 96.0],
    [84.0, 40.0, 8.0],
    [60.0, 12.0, 70.0],
    [10.0, 64.0, 70.0],
    [120.0, 110.0, 96.0],
];

/// 4,096 lamps of 8 colors, each an icosahedron, in a closed hall with two rows of pillars.
pub(super) fn build() -> Shot {
    let mut set = Assembly::new("many_lamps");
    let plaster = set.lambertian("plaster", [0.66, 0.64, 0.60]);
    let stone = set.lambertian("stone", [0.45, 0.42, 0.40]);

    let mut hall = Shape::default();
    let (min, max) = (Vec3::new(-HALL.x, 0.0, -HALL.z), HALL);
    hall.block(min, max);
    hall.turn_inside_out();
    set.add("hall", hall, plaster);

    // Pillars reach a little into floor and ceiling.
    let mut pillar = Shape::default();
    let top = HALL.y + 0.02;
    pillar.lathe(&[[0.0, -0.02], [0.28, -0.02], [0.28, top], [0.0, top]], 24);
    let pillar = set.mesh("pillar", pillar, stone);
    for i in 0..10 {
        let side = if i % 2 == 0 { -1.0 } else { 1.0 };
        let at = Vec3::new(side * 2.6, 0.0, (i / 2) as f32 * 3.0 - 6.0);
        set.place(pillar, Affine3A::from_translation(at));
    }

    let lamps: Vec<u32> = RADIANCES
        .iter()
        .enumerate()
        .map(|(kind, &radiance)| {
            let name = format!("lamp_{kind}");
            let material = set.material(Material {
                emission: radiance.into(),
                ..Material::lambertian(&name, Vec3::splat(0.5))
            });
            let mut ball = Shape::default();
            ball.sphere(0, |p| p * LAMP_RADIUS);
            ball.flat_normals();
            set.mesh(&name, ball, material)
        })
        .collect();
    for string in 0..STRINGS {
        for i in 0..LAMPS_PER_STRING {
            let key = string * LAMPS_PER_STRING + i;
            let kind = (hash01(key) * lamps.len() as f32) as usize % lamps.len();
            set.place(lamps[kind], Affine3A::from_translation(lamp_position(string, i)));
        }
    }
    set.shot(View {
        eye: Vec3::new(0.6, 1.6, 7.4),
        target: Vec3::new(-0.3, 1.7, 0.0),
        vfov_deg: 62.0,
        size_px: [1280, 720],
    })
}

/// Lamp `i` of a string that crosses the hall and sags in the middle; neighbors cross in depth.
fn lamp_position(string: u32, i: u32) -> Vec3 {
    let t = (i as f32 + 0.5) / LAMPS_PER_STRING as f32 * 2.0 - 1.0;
    let z = (string as f32 + 0.5) / STRINGS as f32 * 2.0 - 1.0;
    let sag = 0.5 + 0.6 * hash01(9000 + string);
    let swing = 0.9 * (hash01(7000 + string) - 0.5);
    Vec3::new(
        t * (HALL.x - 0.05),
        HALL.y - 0.15 - sag * (1.0 - t * t),
        z * (HALL.z - 0.6) + swing * t,
    )
}

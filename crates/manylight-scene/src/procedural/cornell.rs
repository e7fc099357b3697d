//! A Cornell box of our own numbers: 2 × 2 × 2 m, open to the camera.

use glam::{Affine3A, Vec3};

use super::shapes::Shape;
use super::{Assembly, View};
use crate::{Material, Shot};

/// Two blocks under one square ceiling lamp of 0.5 × 0.5 m, a red wall and a green one.
pub(super) fn build() -> Shot {
    let mut set = Assembly::new("cornell");
    let white = set.lambertian("white", [0.72, 0.71, 0.68]);
    let red = set.lambertian("red", [0.62, 0.06, 0.05]);
    let green = set.lambertian("green", [0.12, 0.44, 0.10]);
    let lamp = set.material(Material {
        emission: Vec3::new(17.0, 13.5, 9.0),
        ..Material::lambertian("lamp", Vec3::splat(0.7))
    });

    // The room: x and z in −1…1, y in 0…2, every wall facing inward.
    let mut room = Shape::default();
    wall(&mut room, [-1.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -2.0]);
    wall(&mut room, [-1.0, 2.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0]);
    wall(&mut room, [-1.0, 0.0, -1.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
    set.add("room", room, white);
    let mut left = Shape::default();
    wall(&mut left, [-1.0, 0.0, 1.0], [0.0, 0.0, -2.0], [0.0, 2.0, 0.0]);
    set.add("left", left, red);
    let mut right = Shape::default();
    wall(&mut right, [1.0, 0.0, -1.0], [0.0, 0.0, 2.0], [0.0, 2.0, 0.0]);
    set.add("right", right, green);

    // The lamp hangs 2 mm below the ceiling and shines down only.
    let mut quad = Shape::default();
    wall(&mut quad, [-0.25, 1.998, -0.3], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]);
    set.add("lamp", quad, lamp);

    // One unit block, stretched and turned twice.
    let mut block = Shape::default();
    block.block(Vec3::new(-0.5, 0.0, -0.5), Vec3::new(0.5, 1.0, 0.5));
    let block = set.mesh("block", block, white);
    for (size, turn_deg, at) in [
        (Vec3::new(0.58, 1.22, 0.56), 19.0f32, Vec3::new(-0.36, 0.0, -0.34)),
        (Vec3::new(0.60, 0.60, 0.58), -17.0, Vec3::new(0.38, 0.0, 0.30)),
    ] {
        let stand = Affine3A::from_translation(at)
            * Affine3A::from_rotation_y(turn_deg.to_radians())
            * Affine3A::from_scale(size);
        set.place(block, stand);
    }
    set.shot(View {
        eye: Vec3::new(0.0, 1.0, 4.05),
        target: Vec3::new(0.0, 1.0, 0.0),
        vfov_deg: 38.0,
        size_px: [720, 720],
    })
}

/// A quad from its corner along u and v, facing u × v.
pub(super) fn wall(shape: &mut Shape, corner: [f32; 3], u: [f32; 3], v: [f32; 3]) {
    let [corner, u, v] = [corner, u, v].map(Vec3::from);
    shape.patch(1, 1, |s, t| corner + u * s + v * t);
}

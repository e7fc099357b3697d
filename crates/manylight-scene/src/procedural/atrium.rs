//! A courtyard with two storeys of arcades, open to the sky: where the parts stand.
//!
//! The court spans x in ±6 and z in ±12, the arcades 4 m more on every side. Everything of one
//! side is placed in that side's frame: x along the facade, z away from the court.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine2, Affine3A, Vec2, Vec3};

use super::furnishing as furniture;
use super::masonry::{self as stone, BAY};
use super::shapes::Shape;
use super::{Assembly, View};
use crate::{Light, Material, Shot, Sky, TextureSlot, Wrap};

/// Half extent of the court, x and z.
const COURT: Vec2 = Vec2::new(6.0, 12.0);
/// Clear depth of the arcades.
const DEPTH: f32 = 4.0;
/// Height of the columns of both storeys.
const COLUMN: [f32; 2] = [3.2, 2.6];
/// Floor of both storeys and the top of the upper one.
const FLOOR: [f32; 3] = [0.0, 5.0, 9.3];
/// Where curtains hang: (side, bay, color); sides count from +z over +x and −z to −x.
const CURTAINS: [(usize, u32, usize); 10] = [
    (1, 1, 0),
    (1, 3, 1),
    (1, 4, 2),
    (1, 6, 3),
    (3, 1, 2),
    (3, 2, 0),
    (3, 4, 3),
    (3, 6, 1),
    (2, 0, 1),
    (2, 3, 0),
];

/// Indices of the atrium's materials.
struct Palette {
    stone: u32,
    trim: u32,
    plaster: u32,
    floor: u32,
    tiles: u32,
    wood: u32,
    bronze: u32,
    water: u32,
    terracotta: u32,
    leaf: u32,
    cloth: [u32; 4],
}

/// The four sides as frames, with their number of bays.
fn sides() -> [(Affine3A, u32); 4] {
    [0.0, FRAC_PI_2, PI, -FRAC_PI_2].map(|angle: f32| {
        let long = angle.sin().abs() > 0.5;
        let (distance, bays) = if long { (COURT.x, 8) } else { (COURT.y, 4) };
        let frame =
            Affine3A::from_rotation_y(angle) * Affine3A::from_translation(Vec3::Z * distance);
        (frame, bays)
    })
}

/// Where the middle of bay `i` of `n` lies along the facade.
fn bay_x(i: u32, n: u32) -> f32 {
    (i as f32 - 0.5 * (n as f32 - 1.0)) * BAY
}

/// The courtyard in late-morning sun; the camera stands in the shade of one end.
pub(super) fn build() -> Shot {
    let mut set = Assembly::new("atrium");
    let palette = materials(&mut set);
    shell(&mut set, &palette);
    arcades(&mut set, &palette);
    ceilings(&mut set, &palette);
    balustrades(&mut set, &palette);
    drapery(&mut set, &palette);
    court(&mut set, &palette);
    set.scene.lights.push(Light::Sun {
        direction: Vec3::new(-0.42, -1.0, -0.24).normalize(),
        irradiance: Vec3::new(24.0, 21.5, 18.0),
    });
    set.scene.sky = Some(Sky::Constant(Vec3::new(0.55, 0.75, 1.1)));
    set.shot(View {
        eye: Vec3::new(2.1, 1.75, 13.3),
        target: Vec3::new(-1.3, 2.75, 0.0),
        vfov_deg: 62.0,
        size_px: [1280, 720],
    })
}

fn materials(set: &mut Assembly) -> Palette {
    set.scene.images.push(furniture::marble());
    let marble = TextureSlot {
        image: 0,
        uv_set: 0,
        transform: Affine2::IDENTITY,
        wrap: [Wrap::Repeat; 2],
        linear_filter: true,
    };
    Palette {
        stone: set.lambertian("stone", [0.62, 0.55, 0.44]),
        trim: set.lambertian("trim", [0.70, 0.65, 0.56]),
        plaster: set.lambertian("plaster", [0.66, 0.47, 0.31]),
        floor: set.material(Material {
            base_color_texture: Some(marble),
            ..Material::lambertian("floor", Vec3::splat(0.85))
        }),
        tiles: set.lambertian("tiles", [0.58, 0.53, 0.45]),
        wood: set.lambertian("wood", [0.30, 0.19, 0.10]),
        bronze: set.lambertian("bronze", [0.32, 0.23, 0.12]),
        water: set.lambertian("water", [0.10, 0.26, 0.30]),
        terracotta: set.lambertian("terracotta", [0.52, 0.24, 0.14]),
        leaf: set.lambertian("leaf", [0.16, 0.32, 0.08]),
        cloth: [
            ("cloth_red", [0.62, 0.06, 0.05]),
            ("cloth_blue", [0.05, 0.13, 0.52]),
            ("cloth_green", [0.06, 0.38, 0.14]),
            ("cloth_gold", [0.68, 0.42, 0.05]),
        ]
        .map(|(name, albedo): (&str, [f32; 3])| {
            let cloth = Material::lambertian(name, albedo.into());
            set.material(Material { double_sided: true, ..cloth })
        }),
    }
}

/// Four closed boxes around the court, from `inner` to `outer` metres beyond its edge; the short
/// pair is 1 mm lower so that no two faces coincide.
fn ring(shape: &mut Shape, inner: f32, outer: f32, y: [f32; 2]) {
    let (near, far) = (COURT + inner, COURT + outer);
    for sign in [-1.0f32, 1.0] {
        let span = |a: Vec3, b: Vec3| (a.min(b), a.max(b));
        let (min, max) =
            span(Vec3::new(sign * near.x, y[0], -far.y), Vec3::new(sign * far.x, y[1], far.y));
        shape.block(min, max);
        let reach = near.x + 0.2;
        let (min, max) = span(
            Vec3::new(-reach, y[0] + 0.001, sign * near.y),
            Vec3::new(reach, y[1] - 0.001, sign * far.y),
        );
        shape.block(min, max);
    }
}

/// Floors, roof and outer walls: with thickness, overlapping at every seam.
fn shell(set: &mut Assembly, palette: &Palette) {
    let mut walls = Shape::default();
    ring(&mut walls, DEPTH, DEPTH + 0.5, [-0.5, 10.2]);
    set.add("walls", walls, palette.plaster);
    let mut floor = Shape::default();
    ring(&mut floor, -0.42, DEPTH + 0.2, [-0.5, 0.0]);
    floor.map_from_above(1.6);
    set.add("arcade_floor", floor, palette.floor);
    let mut slabs = Shape::default();
    ring(&mut slabs, -0.25, DEPTH + 0.2, [FLOOR[1] - 0.25, FLOOR[1]]);
    ring(&mut slabs, -0.25, DEPTH + 0.2, [FLOOR[2], FLOOR[2] + 0.3]);
    set.add("slabs", slabs, palette.stone);
    let mut ground = Shape::default();
    ground.block(Vec3::new(-COURT.x, -0.5, -COURT.y), Vec3::new(COURT.x, -0.066, COURT.y));
    set.add("ground", ground, palette.stone);
}

/// Columns, corner piers, arches, cornices and parapets.
fn arcades(set: &mut Assembly, palette: &Palette) {
    let columns = [
        set.mesh("column_lower", stone::column(COLUMN[0], 0.25, 0), palette.stone),
        set.mesh("column_upper", stone::column(COLUMN[1], 0.19, 16), palette.trim),
    ];
    let piers = COLUMN.map(|h| set.mesh("pier", stone::pier(h, 0.34), palette.stone));
    let pilasters = COLUMN.map(|h| set.mesh("pilaster", stone::pier(h, 0.2), palette.stone));
    let arches = [0, 1].map(|k| {
        let arch = stone::arch(FLOOR[k + 1] - FLOOR[k] - COLUMN[k]);
        set.mesh("arch", arch, palette.stone)
    });
    let cornice = set.mesh("cornice", stone::cornice(), palette.trim);
    let mut parapet = Shape::default();
    parapet.block(Vec3::new(-0.5 * BAY, 0.0, -0.22), Vec3::new(0.5 * BAY, 0.7, 0.22));
    parapet.block(Vec3::new(-0.5 * BAY, 0.7, -0.28), Vec3::new(0.5 * BAY, 0.8, 0.28));
    let parapet = set.mesh("parapet", parapet, palette.stone);

    for (side, bays) in sides() {
        let at = |x: f32, y: f32, z: f32| side * Affine3A::from_translation(Vec3::new(x, y, z));
        for storey in 0..2 {
            let y = FLOOR[storey];
            for i in 1..bays {
                let x = bay_x(i, bays) - 0.5 * BAY;
                set.place(columns[storey], at(x, y, 0.0));
                // Pilasters on the outer wall answer the columns of the court.
                set.place(pilasters[storey], at(x, y, DEPTH));
            }
            set.place(piers[storey], at(0.5 * BAY * bays as f32, y, 0.0));
            for i in 0..bays {
                let x = bay_x(i, bays);
                set.place(arches[storey], at(x, y + COLUMN[storey], 0.0));
                set.place(cornice, at(x, FLOOR[storey + 1] - 0.38, 0.0));
                if storey == 1 {
                    set.place(parapet, at(x, FLOOR[2] + 0.02, 0.0));
                }
            }
        }
    }
}

/// Groin vaults with ribs below, timber beams above.
fn ceilings(set: &mut Assembly, palette: &Palette) {
    let rise = 1.45;
    let spring = COLUMN[0] + 0.05;
    let half = Vec2::new(0.5 * BAY, 0.5 * DEPTH);
    let vault = set.mesh("vault", stone::vault(half, rise), palette.plaster);
    let corner = set.mesh("vault_corner", stone::vault(Vec2::splat(half.y), rise), palette.plaster);
    let rib = set.mesh("rib", stone::rib(half.y, rise), palette.trim);
    let mut beam = Shape::default();
    beam.block(Vec3::new(-0.09, -0.22, -0.1), Vec3::new(0.09, 0.05, DEPTH + 0.1));
    let beam = set.mesh("beam", beam, palette.wood);
    for (side, bays) in sides() {
        let at = |x: f32, y: f32, z: f32| side * Affine3A::from_translation(Vec3::new(x, y, z));
        let end = 0.5 * BAY * bays as f32;
        for i in 0..bays {
            set.place(vault, at(bay_x(i, bays), spring, half.y));
            for k in 0..4 {
                let x = bay_x(i, bays) + (k as f32 - 1.5) * 0.25 * BAY;
                set.place(beam, at(x, FLOOR[2], 0.0));
            }
        }
        for i in 0..=bays {
            set.place(rib, at(i as f32 * BAY - end, spring, half.y));
        }
        set.place(corner, at(end + half.y, spring, half.y));
    }
}

/// The upper storey's balustrades, and doors in the walls of the lower.
fn balustrades(set: &mut Assembly, palette: &Palette) {
    let baluster = set.mesh("baluster", stone::baluster(), palette.trim);
    let mut rail = Shape::default();
    let half = 0.5 * BAY - 0.1;
    rail.block(Vec3::new(-half, 0.0, -0.13), Vec3::new(half, 0.13, 0.13));
    rail.block(Vec3::new(-half, 0.82, -0.11), Vec3::new(half, 0.87, 0.11));
    rail.block(Vec3::new(-half, 0.87, -0.15), Vec3::new(half, 0.96, 0.15));
    let rail = set.mesh("rail", rail, palette.trim);
    let frame = set.mesh("door_frame", stone::door_frame(), palette.trim);
    let door = set.mesh("door", stone::door(), palette.wood);
    for (side, bays) in sides() {
        let at = |x: f32, y: f32, z: f32| side * Affine3A::from_translation(Vec3::new(x, y, z));
        for i in 0..bays {
            let x = bay_x(i, bays);
            set.place(rail, at(x, FLOOR[1], 0.0));
            for k in 0..9 {
                let along = x + (k as f32 - 4.0) * 0.26;
                set.place(baluster, at(along, FLOOR[1] + 0.125, 0.0));
            }
            for y in [FLOOR[0], FLOOR[1]] {
                if i % 2 == 1 {
                    set.place(frame, at(x, y, DEPTH));
                    set.place(door, at(x, y, DEPTH));
                }
            }
        }
    }
}

/// Curtains in some arches (mirrored in every other one) and banners before the long facades.
fn drapery(set: &mut Assembly, palette: &Palette) {
    let curtains = palette.cloth.map(|m| set.mesh("curtain", furniture::curtain(), m));
    let banners = palette.cloth.map(|m| set.mesh("banner", furniture::banner(), m));
    let long = set.mesh("rod_long", furniture::rod(1.3), palette.bronze);
    let short = set.mesh("rod_short", furniture::rod(0.62), palette.bronze);
    let lying = Affine3A::from_rotation_z(FRAC_PI_2);
    let sides = sides();
    for (side, bay, color) in CURTAINS {
        let (frame, bays) = sides[side];
        let hang = frame * Affine3A::from_translation(Vec3::new(bay_x(bay, bays), 3.16, 0.0));
        let mirror = if bay % 2 == 0 { 1.0 } else { -1.0 };
        set.place(curtains[color], hang * Affine3A::from_scale(Vec3::new(mirror, 0.97, 1.0)));
        set.place(long, hang * lying);
    }
    for (k, side) in [1usize, 3].into_iter().enumerate() {
        let (frame, bays) = sides[side];
        for i in (1..bays).step_by(2) {
            let x = bay_x(i, bays) - 0.5 * BAY;
            let hang = frame * Affine3A::from_translation(Vec3::new(x, 4.55, -0.68));
            set.place(banners[(i as usize / 2 + k) % banners.len()], hang);
            set.place(short, hang * lying);
        }
    }
}

/// Tiles, fountain and plants.
fn court(set: &mut Assembly, palette: &Palette) {
    let paving = set.mesh("tiles", furniture::tiles(COURT - 0.3, 0.6), palette.tiles);
    set.place(paving, Affine3A::from_translation(Vec3::Y * -0.05));
    let down = Affine3A::from_translation(Vec3::Y * -0.05);
    let fountain = set.mesh("fountain", furniture::fountain(), palette.trim);
    set.place(fountain, down);
    let water = set.mesh("water", furniture::water(), palette.water);
    set.place(water, down);
    let pot = set.mesh("pot", furniture::pot(), palette.terracotta);
    let bush = set.mesh("bush", furniture::bush(), palette.leaf);
    for (k, z) in [-9.4f32, -4.6, 4.6, 9.4].into_iter().enumerate() {
        for x in [-4.3f32, 4.3] {
            let stand = Affine3A::from_translation(Vec3::new(x, -0.05, z))
                * Affine3A::from_rotation_y(k as f32 * 1.7 + x)
                * Affine3A::from_scale(Vec3::splat(1.15));
            set.place(pot, stand);
            set.place(bush, stand);
        }
    }
}

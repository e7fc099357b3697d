use super::*;
use crate::bvh::Ray;
use glam::{Affine2, Affine3A, Vec2};
use manylight_scene::{Camera, Instance, Material, Scene, TextureImage, Wrap};

/// A unit square in z = 0 with upright texture coordinates and a normal map of one texel.
fn mapped_square(texel: [u8; 4], world_from_object: Affine3A) -> World {
    let corner = |x, y| Vec3::new(x, y, 0.0);
    let slot = TextureSlot {
        image: 0,
        uv_set: 0,
        transform: Affine2::IDENTITY,
        wrap: [Wrap::Repeat; 2],
        linear_filter: true,
    };
    let mesh = Mesh {
        positions: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)],
        // Row 0 of the image is at the top.
        uvs: [vec![Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO], Vec::new()],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let material = Material { normal_texture: Some(slot), ..Material::default() };
    let image = TextureImage { name: String::new(), width: 1, height: 1, texels: vec![texel] };
    World::new(Scene {
        meshes: vec![mesh],
        instances: vec![Instance { mesh: 0, world_from_object }],
        materials: vec![material],
        images: vec![image],
        ..Scene::default()
    })
    .expect("triangles")
}

fn seen(world: &World, origin: Vec3) -> SurfacePoint {
    let ray = Ray { origin, direction: Vec3::NEG_Z, t_max: 100.0 };
    world.surface(&world.closest(&ray).expect("square"), ray.direction, true)
}

#[test]
fn red_bends_the_normal_right_and_green_up() {
    let origin = Vec3::new(0.3, 0.4, 1.0);
    let world = mapped_square([255, 128, 128, 255], Affine3A::IDENTITY);
    assert!(seen(&world, origin).ns.x > 0.9);
    let world = mapped_square([128, 255, 128, 255], Affine3A::IDENTITY);
    assert!(seen(&world, origin).ns.y > 0.9);
    // Mirrored: the picture of the map is mirrored with the square.
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let world = mapped_square([255, 128, 128, 255], mirror);
    assert!(seen(&world, Vec3::new(-0.3, 0.4, 1.0)).ns.x < -0.9);
    let world = mapped_square([128, 255, 128, 255], mirror);
    assert!(seen(&world, Vec3::new(-0.3, 0.4, 1.0)).ns.y > 0.9);
}

/// On the edge itself, or the slack beyond it, a point would lie behind the neighbor of a corner.
#[test]
fn points_on_an_edge_lie_inside() {
    let world = mapped_square([128, 128, 255, 255], Affine3A::IDENTITY);
    let ray = Ray { origin: Vec3::new(0.4, 0.3, 1.0), direction: Vec3::NEG_Z, t_max: 100.0 };
    let hit = world.closest(&ray).expect("square");
    for barycentrics in [[0.0, 0.3], [-1e-6, 0.5], [0.5, 0.5], [0.5, 0.500_001], [0.0, 0.0]] {
        let point = world.surface(&Hit { barycentrics, ..hit }, ray.direction, true);
        let inside = point.position.truncate();
        assert!(inside.min_element() > 5e-6 && inside.max_element() < 1.0 - 5e-6, "{inside}");
        assert!(inside.x - inside.y > 5e-6, "the other triangle: {inside}");
        let there = Vec2::new(barycentrics[0] + barycentrics[1], barycentrics[1]);
        assert!((inside - there).length() < 3e-5, "{inside}");
    }
    let point = world.surface(&hit, ray.direction, true);
    assert!((point.position - Vec3::new(0.4, 0.3, 0.0)).length() < 1e-6);
}

#[test]
fn camera_rays_span_the_field_of_view() {
    let camera = Camera::look_at(Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 90f32.to_radians());
    let view = ViewFrame::new(&camera.expect("frame"), 200, 100);
    let top = view.ray(Vec2::new(100.0, 0.0)).direction;
    assert!((top - Vec3::new(0.0, 1.0, -1.0).normalize()).length() < 1e-5);
    let right = view.ray(Vec2::new(200.0, 50.0)).direction;
    assert!((right - Vec3::new(2.0, 0.0, -1.0).normalize()).length() < 1e-5);
    assert!((view.depth(Vec3::new(3.0, 1.0, -7.0)) - 7.0).abs() < 1e-6);
}

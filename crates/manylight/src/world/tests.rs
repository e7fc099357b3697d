use super::*;
use glam::{Vec2, Vec4};
use manylight_scene::{AlphaMode, Instance, Material, Mesh, TextureImage, TextureSlot, Wrap};

fn slot(wrap: Wrap, linear_filter: bool) -> TextureSlot {
    TextureSlot {
        image: 0,
        uv_set: 0,
        transform: glam::Affine2::IDENTITY,
        wrap: [wrap; 2],
        linear_filter,
    }
}

fn two_texels() -> Vec<TextureImage> {
    let texels = vec![[0, 0, 0, 255], [255, 255, 255, 255]];
    vec![TextureImage { name: String::new(), width: 2, height: 1, texels }]
}

#[test]
fn textures_wrap_and_filter_as_asked() {
    let images = two_texels();
    let at = |wrap, linear, u: f32| sample_rgba(&images, &slot(wrap, linear), Vec2::new(u, 0.5)).x;
    assert_eq!(at(Wrap::Repeat, false, 0.25), 0.0);
    assert_eq!(at(Wrap::Repeat, false, 1.75), 1.0);
    assert_eq!(at(Wrap::Mirror, false, 1.25), 1.0);
    assert_eq!(at(Wrap::Mirror, false, -0.25), 0.0);
    assert_eq!(at(Wrap::Clamp, false, 7.0), 1.0);
    assert_eq!(at(Wrap::Clamp, false, -7.0), 0.0);
    assert_eq!(at(Wrap::Clamp, true, 0.5), 0.5);
    // At the seam a repeating texture mixes the last texel with the first.
    assert_eq!(at(Wrap::Repeat, true, 0.0), 0.5);
    assert_eq!(at(Wrap::Clamp, true, 0.0), 0.0);
    assert!(at(Wrap::Repeat, true, f32::NAN).is_finite());
}

#[test]
fn colors_are_decoded_before_they_are_filtered() {
    let images = two_texels();
    let c = sample_srgb(&images, &slot(Wrap::Clamp, true), Vec2::new(0.5, 0.5));
    assert!((c - Vec4::new(0.5, 0.5, 0.5, 1.0)).length() < 1e-6);
}

/// A square of two triangles in the plane z = 0, looking toward +z.
fn square() -> Mesh {
    let corner = |x, y| Vec3::new(x, y, 0.0);
    Mesh {
        positions: vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

fn world_of(placements: &[Affine3A], material: Material) -> World {
    let instances =
        placements.iter().map(|&world_from_object| Instance { mesh: 0, world_from_object });
    let scene = Scene {
        meshes: vec![square()],
        instances: instances.collect(),
        materials: vec![material],
        ..Scene::default()
    };
    World::new(scene).expect("triangles")
}

fn toward(z: f32) -> Ray {
    Ray { origin: Vec3::new(0.3, 0.4, -z), direction: Vec3::Z * z.signum(), t_max: 100.0 }
}

#[test]
fn a_mirrored_square_keeps_its_front() {
    let gray = Material::lambertian("gray", Vec3::splat(0.5));
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    for (placement, x) in [(Affine3A::IDENTITY, 0.3), (mirror, -0.3)] {
        let world = world_of(&[placement], gray.clone());
        assert!((world.front_normal(0, 0) - Vec3::Z).length() < 1e-6);
        let ray = Ray { origin: Vec3::new(x, 0.4, 5.0), direction: Vec3::NEG_Z, t_max: 100.0 };
        let hit = world.closest(&ray).expect("square");
        let surface = world.surface(&hit, ray.direction, true);
        assert!((surface.ng - Vec3::Z).length() < 1e-6 && (hit.t - 5.0).abs() < 1e-5);
    }
}

#[test]
fn a_flattened_instance_still_stops_rays() {
    let flat = Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.0));
    let world = world_of(&[flat], Material::default());
    assert!(world.occluded(&toward(3.0)));
    let nothing = Affine3A::from_scale(Vec3::ZERO);
    let scene = Scene { meshes: vec![square()], ..world.scene.clone() };
    let instances = vec![Instance { mesh: 0, world_from_object: nothing }];
    assert!(World::new(Scene { instances, ..scene }).is_err());
}

#[test]
fn opacity_lets_its_share_of_rays_through() {
    let material = |alpha: f32, alpha_mode| Material {
        base_color: Vec4::new(1.0, 1.0, 1.0, alpha),
        alpha_mode,
        ..Material::default()
    };
    let stopped = |m: Material| {
        let world = world_of(&[Affine3A::IDENTITY], m);
        let ray = |i: u32| {
            let [x, y] = crate::math::Sequence::new(8, i).next_2d();
            let origin = Vec3::new(x, y, 2.0);
            Ray { origin, direction: Vec3::NEG_Z, t_max: 9.0 }
        };
        (0..10_000).filter(|&i| world.occluded(&ray(i))).count()
    };
    assert_eq!(stopped(material(0.4, AlphaMode::Mask(0.5))), 0);
    assert_eq!(stopped(material(0.6, AlphaMode::Mask(0.5))), 10_000);
    assert_eq!(stopped(material(0.0, AlphaMode::Opaque)), 10_000);
    let blended = stopped(material(0.3, AlphaMode::Blend));
    assert!((2850..3150).contains(&blended), "{blended}");
}

#[test]
fn copies_are_limited_per_mesh_and_in_all() {
    assert!(!is_shared(COPY_LIMIT * 2, 1, 0), "one placement is no copy");
    assert!(!is_shared(1000, 4000, 0) && is_shared(1000, 4001, 0));
    let nearly_full = COPIES_LIMIT - 1000;
    assert!(!is_shared(1000, 2, nearly_full) && is_shared(1001, 2, nearly_full));
}

#[test]
fn shared_instances_answer_like_copies() {
    let placements: Vec<Affine3A> = (0..6)
        .map(|i| {
            Affine3A::from_translation(Vec3::new(i as f32 * 0.7, 0.1, i as f32))
                * Affine3A::from_rotation_y(i as f32 * 0.3)
                * Affine3A::from_scale(Vec3::new(1.5, 1.0, -1.0))
        })
        .collect();
    let copies = world_of(&placements, Material::default());
    let shared = World::sharing(copies.scene.clone(), |_, _, _| true).expect("triangles");
    assert_eq!(shared.placements.len(), 6);
    for i in 0..2000 {
        let mut s = crate::math::Sequence::new(3, i);
        let origin = Vec3::new(s.next_1d() * 6.0 - 1.0, s.next_1d() * 2.0 - 0.5, -3.0);
        let direction = Vec3::new(s.next_1d() - 0.5, s.next_1d() - 0.5, 1.0);
        let ray = Ray { origin, direction, t_max: 50.0 };
        let (a, b) = (copies.closest(&ray), shared.closest(&ray));
        assert_eq!(copies.occluded(&ray), shared.occluded(&ray));
        assert_eq!(a.map(|h| (h.instance, h.triangle)), b.map(|h| (h.instance, h.triangle)));
    }
}

#[test]
fn shared_meshes_drop_triangles_without_area() {
    let mut scene = world_of(&[Affine3A::IDENTITY; 2], Material::default()).scene;
    let mesh = &mut scene.meshes[0];
    mesh.positions.extend([Vec3::INFINITY, Vec3::splat(9e3)]);
    // One that is not finite and one without area, before the square.
    mesh.triangles.splice(0..0, [[0, 1, 4], [5, 5, 0]]);
    let shared = World::sharing(scene, |_, _, _| true).expect("triangles");
    assert_eq!((shared.placements.len(), &shared.shared[0].triangles[..]), (2, &[2, 3][..]));
    assert!(shared.diagonal() < 2.0);
    let hit = shared.closest(&toward(3.0)).expect("the square");
    assert_eq!(hit.triangle, 3);
}

/// A cube of n³ squares, one per unit of space, turned every which way.
fn cloud(n: u32) -> Scene {
    let placement = |i: u32| {
        let at = Vec3::new((i % n) as f32, (i / n % n) as f32, (i / n / n) as f32);
        let mut s = crate::math::Sequence::new(7, i);
        Affine3A::from_translation(at)
            * Affine3A::from_axis_angle(crate::math::uniform_sphere(s.next_2d()), s.next_1d() * 6.0)
            * Affine3A::from_scale(Vec3::splat(0.4))
    };
    let placements: Vec<_> = (0..n * n * n).map(placement).collect();
    world_of(&placements, Material::default()).scene
}

/// Rays through a cloud of edge `n`.
fn cloud_ray(n: u32, i: u32) -> Ray {
    let mut s = crate::math::Sequence::new(4, i);
    let mut point = || Vec3::new(s.next_1d(), s.next_1d(), s.next_1d()) * n as f32;
    let (origin, target) = (point(), point());
    Ray { origin, direction: target - origin, t_max: 1.0 }
}

#[test]
fn many_shared_instances_answer_like_copies() {
    let n = 20;
    let copies = World::new(cloud(n)).expect("triangles");
    let shared = World::sharing(cloud(n), |_, _, _| true).expect("triangles");
    assert_eq!((copies.placements.len(), shared.placements.len()), (0, 8000));
    let mut differing = 0;
    for i in 0..3000 {
        let ray = cloud_ray(n, i);
        let (a, b) = (copies.closest(&ray), shared.closest(&ray));
        assert_eq!(b.is_some(), shared.occluded(&ray));
        let names = |h: Option<Hit>| h.map(|h| (h.instance, h.triangle));
        differing += u32::from(names(a) != names(b));
        if let (Some(a), Some(b)) = (a, b) {
            assert!(names(Some(a)) != names(Some(b)) || (a.t - b.t).abs() < 1e-4);
        }
    }
    // A ray through an edge may round either way.
    assert!(differing <= 2, "{differing} of 3000 rays differ");
}

#[test]
fn rays_meet_few_of_many_instances() {
    // A line through n³ boxes comes near n of them.
    for n in [10, 40] {
        let world = World::sharing(cloud(n), |_, _, _| true).expect("triangles");
        let mut met = 0;
        for i in 0..500 {
            world.placement_tree.visit_any(&cloud_ray(n, i), |_| {
                met += 1;
                false
            });
        }
        assert!(met / 500 < n, "{} of {} instances met per ray", met / 500, n * n * n);
    }
}

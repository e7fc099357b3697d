use super::*;
use crate::bvh::Ray;
use crate::gpu::testing::{check_kernel, device};
use crate::math::{Sequence, uniform_sphere};
use crate::world::World;
use manylight_scene::TextureImage;

#[test]
fn kernels_match_their_shaders() {
    KERNELS.iter().for_each(|kernel| check_kernel(kernel));
}

/// Rays inside the bounds of a world, every fourth one short.
fn rays(world: &World, count: u32) -> Vec<Ray> {
    let [low, high] = world.bounds;
    let ray = |i| {
        let mut s = Sequence::new(77, i);
        let ([x, y], z) = (s.next_2d(), s.next_1d());
        let origin = low + (high - low) * Vec3::new(x, y, z);
        let direction = uniform_sphere(s.next_2d()) * 3.0;
        let t_max = if i % 4 == 0 { s.next_1d() * world.diagonal() * 0.1 } else { f32::MAX };
        Ray { origin, direction, t_max }
    };
    (0..count).map(ray).collect()
}

fn cast(gpu: &Gpu, world: &World, rays: &[Ray], any: bool) -> Vec<HitRecord> {
    let scene = GpuWorld::new(gpu, world, &SourceLists::default()).expect("world");
    let record = |r: &Ray| {
        let [a, b] = [r.origin.extend(r.t_max), r.direction.extend(0.0)].map(|v| v.to_array());
        [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
    };
    let records: Vec<[f32; 8]> = rays.iter().map(record).collect();
    let list = gpu.upload("rays", &records).expect("rays");
    let hits = gpu.buffer::<HitRecord>("hits", rays.len()).expect("hits");
    let mut rec = gpu.record(Some(scene.group()));
    let params = rec.uniform(&CastParams { count: rays.len() as u32, any: u32::from(any) });
    rec.dispatch_items(&Cast { params, rays: &list, hits: &hits }, rays.len());
    rec.submit().wait().expect("done");
    gpu.read(&hits, rays.len()).expect("read")
}

/// All rays meet what they meet on the processor; barycentrics and distances to rounding.
fn assert_agrees(gpu: &Gpu, world: &World, name: &str) {
    let rays = rays(world, 4096);
    let (nearest, any) = (cast(gpu, world, &rays, false), cast(gpu, world, &rays, true));
    let (mut different, mut touching, mut met) = (0, 0, 0);
    for ((ray, nearest), any) in rays.iter().zip(&nearest).zip(&any) {
        let expected = world.closest(ray);
        let seen = nearest.instance != u32::MAX;
        different += usize::from(expected.is_some() != seen);
        different += usize::from(world.occluded(ray) != (any.instance != u32::MAX));
        let Some(hit) = expected.filter(|_| seen) else { continue };
        met += 1;
        assert!((hit.t - nearest.t).abs() <= 1e-4 * hit.t, "{name}: {hit:?} {nearest:?}");
        // Where triangles touch or lie in one plane, either is right.
        if [hit.instance, hit.triangle] == [nearest.instance, nearest.triangle] {
            let [u, v] = hit.barycentrics;
            let off = (u - nearest.u).abs().max((v - nearest.v).abs());
            assert!(off < 1e-3, "{name}: {hit:?} {nearest:?}");
        } else {
            touching += 1;
        }
    }
    assert!(met > 500, "{name}: only {met} rays met something");
    // At edges the last bits decide.
    assert!(different <= 1, "{name}: {different} rays differ");
    assert!(touching <= rays.len() / 100, "{name}: {touching} rays met another triangle");
}

#[test]
fn rays_meet_the_same_surfaces() {
    let Some(gpu) = device() else { return };
    for name in ["builtin:cornell", "builtin:atrium"] {
        let shot = manylight_scene::load(name).expect("scene");
        let world = World::new(shot.scene.clone()).expect("world");
        assert_agrees(gpu, &world, name);
        let shared = World::sharing(shot.scene, |_, _, _| true).expect("world");
        assert_agrees(gpu, &shared, &format!("{name}, shared"));
    }
}

#[test]
fn one_triangle_and_rays_without_a_place() {
    let Some(gpu) = device() else { return };
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        triangles: vec![[0, 1, 2]],
        ..Mesh::default()
    };
    let instance =
        manylight_scene::Instance { mesh: 0, world_from_object: glam::Affine3A::IDENTITY };
    let world = World::new(manylight_scene::Scene {
        meshes: vec![mesh],
        instances: vec![instance],
        materials: vec![Material::default()],
        ..Default::default()
    })
    .expect("world");
    let ray = |origin, direction| Ray { origin, direction, t_max: f32::MAX };
    let down = ray(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z);
    let rays = [
        down,
        ray(Vec3::new(0.8, 0.8, 1.0), Vec3::NEG_Z),
        Ray { t_max: 0.5, ..down },
        ray(Vec3::splat(f32::NAN), Vec3::NEG_Z),
        ray(Vec3::Z, Vec3::new(0.0, f32::INFINITY, -1.0)),
        ray(Vec3::Z, Vec3::ZERO),
    ];
    let hits = cast(gpu, &world, &rays, false);
    let met: Vec<bool> = hits.iter().map(|h| h.instance == 0).collect();
    assert_eq!(met, [true, false, false, false, false, false]);
    assert!((hits[0].t - 1.0).abs() < 1e-6);
}

#[test]
fn texels_that_are_cut_out_let_rays_through() {
    let Some(gpu) = device() else { return };
    let mut shot = manylight_scene::load("builtin:cornell").expect("scene");
    let texels = (0..64).map(|i| [200, 100, 50, if (i / 8 + i) % 2 == 0 { 255 } else { 60 }]);
    let texels = texels.collect();
    shot.scene.images = vec![TextureImage { name: "holes".into(), width: 8, height: 8, texels }];
    for (i, material) in shot.scene.materials.iter_mut().enumerate() {
        material.alpha_mode = if i % 2 == 0 { AlphaMode::Mask(0.5) } else { AlphaMode::Blend };
        material.base_color_texture = Some(TextureSlot {
            image: 0,
            uv_set: 0,
            transform: glam::Affine2::from_scale(glam::Vec2::splat(3.0)),
            wrap: [Wrap::Mirror, Wrap::Repeat],
            linear_filter: i % 3 != 0,
        });
    }
    for mesh in &mut shot.scene.meshes {
        let uv = |p: &Vec3| glam::Vec2::new(p.x + p.y, p.z - p.y);
        mesh.uvs[0] = mesh.positions.iter().map(uv).collect();
    }
    let world = World::new(shot.scene).expect("world");
    assert_agrees(gpu, &world, "holes");
}

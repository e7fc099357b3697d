use super::*;
use crate::bvh::Ray;
use crate::gpu::testing::{check_kernel, device, device_with};
use crate::math::{Sequence, uniform_sphere};
use crate::world::World;
use manylight_scene::TextureImage;
use std::sync::OnceLock;

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
    cast_into(gpu, scene.group(), rays, any)
}

fn cast_into(gpu: &Gpu, scene: &SceneGroup, rays: &[Ray], any: bool) -> Vec<HitRecord> {
    let list = upload_rays(gpu, rays);
    let hits = gpu.buffer::<HitRecord>("hits", rays.len()).expect("hits");
    let mut rec = gpu.record(Some(scene));
    let params = rec.uniform(&CastParams { count: rays.len() as u32, any: u32::from(any) });
    rec.dispatch_items(&Cast { params, rays: &list, hits: &hits }, rays.len());
    rec.submit().wait().expect("done");
    gpu.read(&hits, rays.len()).expect("read")
}

fn upload_rays(gpu: &Gpu, rays: &[Ray]) -> Buf<[f32; 8]> {
    let record = |r: &Ray| {
        let [a, b] = [r.origin.extend(r.t_max), r.direction.extend(0.0)].map(|v| v.to_array());
        [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
    };
    let records: Vec<[f32; 8]> = rays.iter().map(record).collect();
    gpu.upload("rays", &records).expect("rays")
}

/// Whether the rays are stopped on their way through the binary hierarchy; it knows no instances.
fn stopped_in_binary(gpu: &Gpu, world: &World, rays: &[Ray]) -> Option<Vec<u32>> {
    let binary = BinaryWorld::new(gpu, world).expect("hierarchy")?;
    let scene = GpuWorld::new(gpu, world, &SourceLists::default()).expect("world");
    let list = upload_rays(gpu, rays);
    let stopped = gpu.buffer::<u32>("stopped", rays.len()).expect("stopped");
    let mut rec = gpu.record(Some(scene.group()));
    let params = rec.uniform(&CastParams { count: rays.len() as u32, any: 1 });
    rec.dispatch_items(&binary.cast(params, &list, &stopped), rays.len());
    rec.submit().wait().expect("done");
    Some(gpu.read(&stopped, rays.len()).expect("read"))
}

#[test]
fn the_binary_hierarchy_stops_the_same_rays() {
    let Some(gpu) = device() else { return };
    let atrium = manylight_scene::load("builtin:atrium").expect("scene").scene;
    for scene in [scene_with_holes(), atrium] {
        let world = World::new(scene).expect("world");
        let rays = rays(&world, 4096);
        let stopped = stopped_in_binary(gpu, &world, &rays).expect("no shared meshes");
        let wide = cast(gpu, &world, &rays, true);
        let wide = wide.iter().map(|hit| u32::from(hit.instance != u32::MAX));
        let different = stopped.iter().zip(wide).filter(|(a, b)| **a != *b).count();
        assert!(stopped.contains(&0) && stopped.contains(&1));
        assert!(different <= 1, "{different} rays differ");
    }
    let shot = manylight_scene::load("builtin:cornell").expect("scene");
    let shared = World::sharing(shot.scene, |_, _, _| true).expect("world");
    assert!(stopped_in_binary(gpu, &shared, &[]).is_none());
}

/// Rays of 4096 that may meet something where they do not on the processor, or the other way round:
/// at edges the last bits decide.
const MOST_DIFFERENT: usize = 1;
/// Rays that may meet another triangle at the same distance: among instances the order decides.
const MOST_TOUCHING: usize = 40;

/// All rays meet what they meet on the processor, but for at most some that do or do not meet
/// something and some that meet another triangle; barycentrics and distances to rounding.
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
        // Roundings of the distance, and of the place where the ray starts.
        let most_off = 1e-4 * hit.t + 2e-7 * world.diagonal() / ray.direction.length();
        assert!((hit.t - nearest.t).abs() <= most_off, "{name}: {hit:?} {nearest:?}");
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
    println!("{name}: {met} of {} rays met, {different} differ, {touching} touch", rays.len());
    assert!(different <= MOST_DIFFERENT, "{name}: {different} rays differ");
    assert!(touching <= MOST_TOUCHING, "{name}: {touching} rays met another triangle");
}

/// A device with ray queries; one for all tests, since their pipelines take long.
fn device_with_queries() -> Option<&'static Gpu> {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    if GPU.get().is_none() {
        // Each test says so where there is none.
        let opened = device_with(Feature::RayQueries)?;
        return Some(GPU.get_or_init(|| opened));
    }
    GPU.get()
}

#[test]
fn rays_meet_the_same_surfaces() {
    let Some(gpu) = device() else { return };
    assert_scenes_agree(gpu);
}

#[test]
fn ray_queries_meet_the_same_surfaces() {
    let Some(gpu) = device_with_queries() else { return };
    assert_scenes_agree(gpu);
}

fn assert_scenes_agree(gpu: &Gpu) {
    for name in ["builtin:cornell", "builtin:atrium"] {
        let shot = manylight_scene::load(name).expect("scene");
        let world = World::new(shot.scene.clone()).expect("world");
        assert_agrees(gpu, &world, name);
        let shared = World::sharing(shot.scene, |_, _, _| true).expect("world");
        assert_agrees(gpu, &shared, &format!("{name}, shared"));
        let [a, b] = [
            cast(gpu, &shared, &rays(&shared, 999), false),
            cast(gpu, &shared, &rays(&shared, 999), false),
        ];
        assert_eq!(a, b, "{name}: two runs");
    }
}

#[test]
fn kernels_leave_out_what_no_ray_meets_and_find_the_same() {
    device().into_iter().for_each(check_traits);
}

#[test]
fn ray_queries_leave_out_what_no_ray_meets_and_find_the_same() {
    device_with_queries().into_iter().for_each(check_traits);
}

fn check_traits(gpu: &Gpu) {
    let cornell = || manylight_scene::load("builtin:cornell").expect("scene").scene;
    let worlds = [
        (World::new(cornell()), [false, false]),
        (World::sharing(cornell(), |_, _, _| true), [true, false]),
        (World::new(scene_with_holes()), [false, true]),
    ];
    for (world, [placements, holes]) in worlds {
        let world = world.expect("world");
        let scene = GpuWorld::new(gpu, &world, &SourceLists::default()).expect("world");
        let own = scene.group();
        // The hardware follows rays through one tree of them all.
        let placements = placements || gpu.features().has(Feature::RayQueries);
        assert_eq!(own.traits, SceneTraits { placements, holes });
        let full = SceneGroup { traits: SceneTraits::ALL, ..own.clone() };
        let rays = rays(&world, 2048);
        for any in [false, true] {
            let found = cast_into(gpu, own, &rays, any);
            assert!(found == cast_into(gpu, &full, &rays, any), "{:?}, any {any}", own.traits);
            assert!(found.iter().any(|hit| hit.instance != u32::MAX));
        }
    }
}

#[test]
fn one_triangle_and_rays_without_a_place() {
    device().into_iter().for_each(check_rays_without_a_place);
}

#[test]
fn ray_queries_leave_out_rays_without_a_place() {
    device_with_queries().into_iter().for_each(check_rays_without_a_place);
}

fn check_rays_without_a_place(gpu: &Gpu) {
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
        Ray { t_max: 0.0, ..down },
        Ray { t_max: -1.0, ..down },
        Ray { t_max: 1.0, ..down },
        Ray { t_max: 1.000001, ..down },
        ray(Vec3::new(0.2, 0.2, 0.0), Vec3::NEG_Z),
    ];
    let meets = rays.each_ref().map(|ray| world.closest(ray).is_some());
    for any in [false, true] {
        let hits = cast(gpu, &world, &rays, any);
        let met: Vec<bool> = hits.iter().map(|h| h.instance == 0).collect();
        assert_eq!(met, meets, "any {any}");
        assert!((hits[0].t - 1.0).abs() < 1e-6);
    }
}

#[test]
fn texels_that_are_cut_out_let_rays_through() {
    device().into_iter().for_each(check_holes);
}

#[test]
fn ray_queries_pass_texels_that_are_cut_out() {
    device_with_queries().into_iter().for_each(check_holes);
}

fn check_holes(gpu: &Gpu) {
    let world = World::new(scene_with_holes()).expect("world");
    assert_agrees(gpu, &world, "holes");
    let shared = World::sharing(scene_with_holes(), |_, _, _| true).expect("world");
    assert_agrees(gpu, &shared, "holes, shared");
}

/// A scene with masked, blended and opaque surfaces.
fn scene_with_holes() -> manylight_scene::Scene {
    let mut shot = manylight_scene::load("builtin:cornell").expect("scene");
    let texels = (0..64).map(|i| [200, 100, 50, if (i / 8 + i) % 2 == 0 { 255 } else { 60 }]);
    let texels = texels.collect();
    shot.scene.images = vec![TextureImage { name: "holes".into(), width: 8, height: 8, texels }];
    for (i, material) in shot.scene.materials.iter_mut().enumerate() {
        let modes = [AlphaMode::Mask(0.5), AlphaMode::Blend, AlphaMode::Opaque];
        material.alpha_mode = modes[i % 3];
        material.base_color_texture = Some(TextureSlot {
            image: 0,
            uv_set: 0,
            transform: glam::Affine2::from_scale(glam::Vec2::splat(3.0)),
            wrap: [Wrap::Mirror, Wrap::Repeat],
            linear_filter: i % 2 != 0,
        });
    }
    for mesh in &mut shot.scene.meshes {
        let uv = |p: &Vec3| glam::Vec2::new(p.x + p.y, p.z - p.y);
        mesh.uvs[0] = mesh.positions.iter().map(uv).collect();
    }
    shot.scene
}

use super::textures::{Limits, Plan};
use super::*;
use crate::gpu::testing::{check_kernel, device, device_with};
use crate::gpu::{Feature, GROUP, KernelInfo};
use crate::math::{Sequence, hash_u32};
use crate::world::{sample_rgba, sample_srgb};
use glam::{Affine2, Vec2};
use manylight_scene::{Instance, Scene, TextureImage};

record! {
    /// What [`Probe`] needs to know.
    struct ProbeParams {
        count: u32,
        srgb: u32,
    }
}

kernel! {
    /// Values of texture slots.
    struct Probe = "world/probe", [GROUP, 1, 1], scene, [CONSTANTS];
    uniform params: ProbeParams, read asked: [f32; 4], write found: [f32; 4]
}

const KERNELS: &[&KernelInfo] = &[&Probe::INFO];
/// Points that are asked for.
const POINTS: u32 = 4096;
/// Which of every 97 of them are so far away that the last bits decide between texels.
const FAR: u32 = 2;

#[test]
fn kernels_match_their_shaders() {
    KERNELS.iter().for_each(|kernel| check_kernel(kernel));
}

fn image(size: [u32; 2], seed: u32) -> TextureImage {
    let texel = |i| hash_u32(seed ^ hash_u32(i)).to_le_bytes();
    let texels = (0..size[0] * size[1]).map(texel).collect();
    TextureImage { name: format!("image {seed}"), width: size[0], height: size[1], texels }
}

/// A triangle for each of some images, which its material takes for its color in one of many ways;
/// with `normals` every second one for its normals too.
fn textured(sizes: &[[u32; 2]], normals: bool) -> Scene {
    let wraps = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];
    let slot = |i: usize| TextureSlot {
        image: i as u32,
        uv_set: 0,
        transform: Affine2::from_scale_angle_translation(Vec2::splat(1.5), 0.3, Vec2::splat(-0.2)),
        wrap: [wraps[i % 3], wraps[i / 3 % 3]],
        linear_filter: i % 4 != 3,
    };
    let material = |i: usize| Material {
        base_color_texture: Some(slot(i)),
        normal_texture: (normals && i % 2 == 1).then(|| slot(i)),
        ..Material::default()
    };
    let mesh = |i: usize| Mesh {
        positions: [Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p + Vec3::Z * i as f32).to_vec(),
        triangles: vec![[0, 1, 2]],
        material: i as u32,
        ..Mesh::default()
    };
    let instance = |i| Instance { mesh: i as u32, world_from_object: glam::Affine3A::IDENTITY };
    // A scene without a texture has a triangle all the same.
    let count = sizes.len().max(1);
    let mut materials: Vec<_> = (0..count).map(material).collect();
    if sizes.is_empty() {
        materials[0] = Material::default();
    }
    Scene {
        images: sizes.iter().enumerate().map(|(i, &size)| image(size, i as u32)).collect(),
        meshes: (0..count).map(mesh).collect(),
        instances: (0..count).map(instance).collect(),
        materials,
        ..Scene::default()
    }
}

/// Slots that a scene has: color and normals of its materials, in order.
fn slots(scene: &Scene) -> Vec<&TextureSlot> {
    let materials = scene.materials.iter();
    materials.flat_map(|m| [&m.base_color_texture, &m.normal_texture]).flatten().collect()
}

/// Coordinates around 0…1, far away, and none at all.
fn points(slot_count: usize) -> Vec<[f32; 4]> {
    let point = |i| {
        let [u, v] = Sequence::new(5, i).next_2d();
        let slot = (i % slot_count as u32) as f32;
        match i % 97 {
            0 => [f32::NAN, v, slot, 0.0],
            1 => [f32::INFINITY, -v, slot, 0.0],
            FAR => [u * 1e6, v * -1e6, slot, 0.0],
            _ => [u * 4.0 - 2.0, v * 4.0 - 2.0, slot, 0.0],
        }
    };
    (0..POINTS).map(point).collect()
}

/// Values of a scene's slots on a device.
fn probe(gpu: &Gpu, world: &World, asked: &[[f32; 4]], srgb: bool) -> Vec<[u32; 4]> {
    let scene = GpuWorld::new(gpu, world, &SourceLists::default()).expect("world");
    let list = gpu.upload("asked", asked).expect("asked");
    let found = gpu.buffer::<[f32; 4]>("found", asked.len()).expect("found");
    let mut rec = gpu.record(Some(scene.group()));
    let params = rec.uniform(&ProbeParams { count: asked.len() as u32, srgb: u32::from(srgb) });
    rec.dispatch_items(&Probe { params, asked: &list, found: &found }, asked.len());
    rec.submit().wait().expect("done");
    let found = gpu.read(&found, asked.len()).expect("read");
    found.into_iter().map(|v| v.map(f32::to_bits)).collect()
}

/// Scenes of one image, of odd sizes in all ways of wrapping, of very many images.
fn scenes() -> Vec<Scene> {
    let side = |i: u32| 1 + hash_u32(i) % 61;
    let odd: Vec<_> = (0..18).map(|i| [side(i), side(i + 100)]).collect();
    let many: Vec<_> = (0..1100).map(|i| [1 + i % 5, 1 + i % 7]).collect();
    vec![textured(&[[37, 11]], true), textured(&odd, true), textured(&many, false)]
}

#[test]
fn texels_are_those_of_the_processor() {
    let Some(gpu) = device() else { return };
    for scene in scenes() {
        let world = World::new(scene).expect("world");
        let slots = slots(&world.scene);
        let asked = points(slots.len());
        for srgb in [false, true] {
            let sample = if srgb { sample_srgb } else { sample_rgba };
            let found = probe(gpu, &world, &asked, srgb);
            let mut different = 0;
            for (i, (at, found)) in asked.iter().zip(found).enumerate() {
                if i % 97 == FAR as usize {
                    continue;
                }
                let slot = slots[at[2] as usize];
                let expected = sample(&world.scene.images, slot, Vec2::new(at[0], at[1]));
                let found = glam::Vec4::from_array(found.map(f32::from_bits));
                let same = (expected - found).abs().max_element() < 1e-4;
                different += usize::from(!same);
            }
            // Without a filter the last bits decide where a texel ends.
            assert!(different <= 4, "{} images: {different}", world.scene.images.len());
        }
    }
}

#[test]
fn bindless_texels_have_the_same_bits() {
    let Some(gpu) = device() else { return };
    let Some(bindless) = device_with(Feature::Bindless) else { return };
    for scene in scenes() {
        let world = World::new(scene).expect("world");
        let asked = points(slots(&world.scene).len());
        for srgb in [false, true] {
            let [a, b] = [gpu, &bindless].map(|gpu| probe(gpu, &world, &asked, srgb));
            assert_eq!(a, b, "{} images", world.scene.images.len());
        }
    }
    bindless.check().expect("no problem");
}

#[test]
fn bindless_needs_no_image() {
    let Some(gpu) = device_with(Feature::Bindless) else { return };
    let world = World::new(textured(&[], false)).expect("world");
    let _scene = GpuWorld::new(&gpu, &world, &SourceLists::default()).expect("world");
    assert!(gpu.lists().contains(&("textures", 4)), "{:?}", gpu.lists());
    gpu.check().expect("no problem");
}

const BASE: Limits = Limits { side: 8192, layers: 256, textures: None };

#[test]
fn images_have_textures_of_their_own_while_the_device_binds_as_many() {
    let scene = textured(&[[30, 20], [7, 5], [9, 9]], false);
    let own = Plan::new(&scene, Limits { textures: Some(3), ..BASE }).expect("plan");
    assert_eq!(own.pages, [[30, 20], [7, 5], [9, 9]]);
    assert!(own.places.iter().enumerate().all(|(i, p)| (p.page, p.x, p.y) == (i as u32, 0, 0)));
    let pages = Plan::new(&scene, Limits { textures: Some(2), ..BASE }).expect("plan");
    assert_eq!(pages.pages.len(), 1);
    let array = Plan::new(&scene, BASE).expect("plan");
    assert_eq!((array.pages, array.places), (pages.pages, pages.places));
}

#[test]
fn what_nothing_reads_stays_behind() {
    let mut scene = textured(&[[64, 64], [32, 32], [16, 16]], false);
    scene.materials[0].metallic_roughness_texture = scene.materials[0].base_color_texture.take();
    scene.instances.pop();
    let plan = Plan::new(&scene, BASE).expect("plan");
    assert_eq!((plan.bytes(), plan.places[0].size), (32 * 32 * 4, [0; 2]));
}

#[test]
fn what_does_not_fit_is_named() {
    let large = textured(&[[9000, 1]], false);
    let problem = Plan::new(&large, BASE).expect_err("too large");
    assert!(problem.contains("image 0 has 9000 x 1 texels"), "{problem}");
    assert!(problem.contains("8192 along a side"), "{problem}");
    let many = textured(&[[8, 8]; 5], false);
    let problem =
        Plan::new(&many, Limits { side: 8, layers: 4, textures: None }).expect_err("too many");
    assert!(problem.contains("5 pages of 8 x 8") && problem.contains("4 are allowed"), "{problem}");
}

/// Real scenes where they are found.
fn real_scenes() -> Vec<Scene> {
    let Some(folder) = manylight_testing::scenes() else { return Vec::new() };
    let names = ["animated_stage", "classroom", "country_kitchen", "sponza", "white_room"];
    let paths = names.map(|name| folder.join(name).with_extension("glb").display().to_string());
    paths.map(|path| manylight_scene::load(&path).expect("scene").scene).into()
}

#[test]
fn pages_of_real_scenes_waste_little() {
    for scene in real_scenes() {
        let images = &scene.images;
        let plan = Plan::new(&scene, BASE).expect("plan");
        let each = Plan::new(&scene, Limits { textures: Some(1024), ..BASE }).expect("plan");
        let side = |f: fn(&TextureImage) -> u32| u64::from(images.iter().map(f).max().unwrap_or(0));
        let array = 4 * side(|i| i.width) * side(|i| i.height) * images.len() as u64;
        let share = each.bytes() as f64 / plan.bytes() as f64;
        println!(
            "{}: {} images; bytes: each its own {}, pages {} ({} of {:?}, {:.1} % full), one layer \
             each {array}",
            scene.name,
            images.len(),
            each.bytes(),
            plan.bytes(),
            plan.pages.len(),
            plan.pages.first(),
            100.0 * share
        );
        assert!(share > 0.9, "{}: {share}", scene.name);
    }
}

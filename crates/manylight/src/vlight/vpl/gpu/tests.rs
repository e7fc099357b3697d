use super::*;
use crate::emitter::Emitters;
use crate::emitter::gpu::testing::{Lit, agree, darken, scenes};
use crate::gpu::testing::{check_kernel, device};
use crate::vlight::vpl::{VplSet, trace, trace_emitters};
use crate::world::World;
use crate::world::gpu::GpuWorld;
use glam::{DVec3, Vec3};

const SEED: u32 = 5;

#[test]
fn kernels_match_their_shaders() {
    KERNELS.iter().copied().flatten().for_each(|kernel| check_kernel(kernel));
}

/// A set as the device holds it.
fn read(gpu: &Gpu, vpls: &GpuVpls) -> (VplInfo, Vec<VplRecord>) {
    let info = gpu.read(&vpls.info, 1).expect("info")[0];
    (info, gpu.read(&vpls.lights, info.count as usize).expect("lights"))
}

fn trace_with(
    gpu: &Gpu,
    scene: &GpuWorld,
    tracer: &VplTracer,
    count: u32,
    bounces: u32,
) -> (VplInfo, Vec<VplRecord>) {
    let vpls = GpuVpls::new(gpu, count, bounces).expect("room");
    let mut rec = gpu.record(Some(scene.group()));
    tracer.record(&mut rec, true, SEED, &vpls);
    rec.submit().wait().expect("done");
    read(gpu, &vpls)
}

fn traced(gpu: &Gpu, lit: &Lit, count: u32, bounces: u32) -> (VplInfo, Vec<VplRecord>) {
    let tracer = VplTracer::new(gpu, count, bounces).expect("tracer");
    trace_with(gpu, &lit.scene, &tracer, count, bounces)
}

/// How two sets differ.
#[derive(Debug, PartialEq)]
struct Difference {
    /// Share of lights that lie elsewhere.
    places: f64,
    /// Share of lights that lie there and shine otherwise.
    colors: f64,
    /// Relative, of all intensities together.
    total: f64,
}

fn compare(world: &World, expected: &[Vpl], found: &[VplRecord]) -> Difference {
    let (mut elsewhere, mut otherwise, mut sums) = (0, 0, [DVec3::ZERO; 2]);
    for (a, b) in expected.iter().zip(found) {
        let intensity = Vec3::from(b.intensity);
        let same_place = agree(a.position, b.position.into(), world.diagonal())
            && agree(a.normal, b.normal.into(), 1.0);
        elsewhere += usize::from(!same_place);
        otherwise += usize::from(same_place && !agree(a.intensity, intensity, 0.0));
        sums[0] += a.intensity.as_dvec3();
        sums[1] += intensity.as_dvec3();
    }
    let share = |n: usize| n as f64 / expected.len().max(1) as f64;
    let total = (sums[0] - sums[1]).length() / sums[0].length().max(1e-30);
    Difference { places: share(elsewhere), colors: share(otherwise), total }
}

/// Every light is the same but for rounding.
fn assert_agrees(world: &World, expected: &[Vpl], found: &[VplRecord]) {
    assert_eq!(expected.len(), found.len());
    let difference = compare(world, expected, found);
    assert!(difference.places + difference.colors == 0.0, "{difference:?}");
}

#[test]
fn light_paths_leave_the_lights_of_the_processor() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        let Lit { world, emitters, .. } = lit;
        for (count, bounces) in [(2000, 3), (500, 1), (500, 8)] {
            let name = format!("{}, {count} lights, {bounces} bounces", lit.name);
            let expected = trace(world, emitters, count, bounces, SEED, true);
            let (info, found) = traced(gpu, lit, count, bounces);
            assert_eq!(info.missing, 0, "{name}");
            assert_eq!(u64::from(info.path_count), expected.path_count, "{name}");
            assert_eq!(info.count as usize, expected.lights.len(), "{name}");
            let difference = compare(world, &expected.lights, &found);
            assert!(difference.places <= 1e-3, "{name}: {difference:?}");
            assert!(difference.total <= 1e-3, "{name}: {difference:?}");
            assert!(difference.colors <= 1e-3, "{name}: {difference:?}");
        }
    }
}

#[test]
fn a_set_is_the_same_whatever_the_batches_are() {
    let Some(gpu) = device() else { return };
    let lit = &scenes(gpu)[0];
    let (count, bounces) = (1500, 3);
    let expected = traced(gpu, lit, count, bounces);
    assert!(traced(gpu, lit, count, bounces) == expected);
    for (batch, rounds) in [(299, 4), (2000, 1)] {
        let mut tracer = VplTracer::with_batch(gpu, count, bounces, batch).expect("tracer");
        let found = trace_with(gpu, &lit.scene, &tracer, count, bounces);
        assert_eq!(found.0, VplInfo { rounds, ..expected.0 }, "batches of {batch}");
        assert!(found.1 == expected.1, "batches of {batch}");
        // The memory of one set serves the next, and it has no more rounds than it needs.
        let first_rounds = tracer.rounds();
        tracer.learn_rounds(found.0.rounds);
        assert!(tracer.rounds() == rounds + 1 && rounds + 1 < first_rounds);
        assert!(trace_with(gpu, &lit.scene, &tracer, count, bounces) == found);
        tracer.doubt_rounds();
        assert_eq!(tracer.rounds(), (2 * rounds + 2).min(first_rounds));
    }
}

#[test]
fn few_lights_and_deep_paths() {
    let Some(gpu) = device() else { return };
    let lit = &scenes(gpu)[0];
    let Lit { world, emitters, .. } = lit;
    for (count, bounces) in [(1, 1), (1, 8), (2, 64)] {
        let expected = trace(world, emitters, count, bounces, SEED, true);
        let (info, found) = traced(gpu, lit, count, bounces);
        assert_eq!(
            (u64::from(info.path_count), found.len(), info.missing),
            (expected.path_count, expected.lights.len(), 0)
        );
        assert_agrees(world, &expected.lights, &found);
    }
}

#[test]
fn too_few_rounds_are_told_and_more_make_up_for_them() {
    let Some(gpu) = device() else { return };
    let lit = &scenes(gpu)[0];
    let (count, bounces) = (3000, 3);
    let expected = traced(gpu, lit, count, bounces);
    let mut tracer = VplTracer::with_batch(gpu, count, bounces, 200).expect("tracer");
    tracer.set_rounds(3);
    let (info, found) = trace_with(gpu, &lit.scene, &tracer, count, bounces);
    assert_eq!((info.path_count, info.count, info.rounds), (600, found.len() as u32, 3));
    assert_eq!(info.missing, count - info.count);
    // Fewer lights are as bright together.
    let total = |lights: &[VplRecord]| {
        lights.iter().flat_map(|light| light.intensity).map(f64::from).sum::<f64>()
    };
    let share = total(&found) / total(&expected.1);
    assert!((share - 1.0).abs() < 0.1, "{share} of the light by {} of {count}", info.count);
    tracer.set_rounds(30);
    let (info, found) = trace_with(gpu, &lit.scene, &tracer, count, bounces);
    assert!(found == expected.1 && info.missing == 0);
    tracer.set_rounds(u32::MAX);
    assert!(tracer.rounds() < 5000);
}

#[test]
fn rounds_are_those_of_the_longest_set_and_a_lack_is_not_unlearned() {
    let Some(gpu) = device() else { return };
    let mut tracer = VplTracer::with_batch(gpu, 3000, 3, 200).expect("tracer");
    let first = tracer.rounds();
    let mut learned = |rounds| {
        tracer.learn_rounds(rounds);
        tracer.rounds()
    };
    assert!(first > 40, "{first}");
    assert_eq!([learned(16), learned(3), learned(17)], [19, 19, 20]);
    // Of other lights, which may need more, but no more than any light.
    tracer.doubt_rounds();
    assert_eq!(tracer.rounds(), 36);
    tracer.learn_rounds(3);
    assert_eq!((tracer.rounds(), tracer.most_taken()), (4, [3, 17]));
    tracer.recall_rounds(30);
    tracer.doubt_rounds();
    assert_eq!(tracer.rounds(), first);
    // Fewer than before any set were too few: those may do, and fewer will not be taken again.
    tracer.learn_rounds(3);
    tracer.lack_rounds(tracer.rounds());
    assert_eq!((tracer.rounds(), tracer.needed_rounds()), (first, None));
    tracer.learn_rounds(3);
    assert_eq!(tracer.rounds(), 8);
    // Three sets were under way when the first was known to lack some.
    (0..3).for_each(|_| tracer.lack_rounds(8));
    assert_eq!((tracer.rounds(), tracer.needed_rounds()), (first, None));
    tracer.learn_rounds(3);
    assert_eq!(tracer.rounds(), 15);
    // One had fewer than there are now, and as many are too few.
    tracer.lack_rounds(14);
    assert_eq!(tracer.rounds(), first);
    tracer.learn_rounds(3);
    assert_eq!(tracer.rounds(), 25);
    (0..3).for_each(|_| tracer.lack_rounds(25));
    (0..3).for_each(|_| tracer.lack_rounds(first));
    assert_eq!((tracer.rounds(), tracer.needed_rounds()), (2 * first, Some(2 * first)));
    tracer.learn_rounds(3);
    assert_eq!(tracer.rounds(), 2 * first);
    tracer.doubt_rounds();
    assert_eq!(tracer.rounds(), 2 * first);
}

/// A scene without light, which no renderer takes.
fn dark_scene(gpu: &Gpu) -> (World, Emitters, GpuWorld) {
    let mut shot = manylight_scene::builtin("cornell").expect("cornell");
    darken(&mut shot.scene);
    let world = World::new(shot.scene).expect("world");
    let emitters = Emitters::new(&world);
    let words = crate::emitter::gpu::pack(&world, &emitters);
    let scene = GpuWorld::new(gpu, &world, &words).expect("scene");
    (world, emitters, scene)
}

#[test]
fn a_dark_scene_has_no_lights() {
    let Some(gpu) = device() else { return };
    let (world, emitters, scene) = dark_scene(gpu);
    let tracer = VplTracer::new(gpu, 100, 3).expect("tracer");
    let (info, found) = trace_with(gpu, &scene, &tracer, 100, 3);
    // On the processor no path is traced at all; here all are, until tracing gives up.
    assert_eq!((found.len(), info.missing), (0, 0));
    assert!(trace(&world, &emitters, 100, 3, SEED, true).lights.is_empty());
    let (info, found) = on_emitters(gpu, &scene, 100);
    assert_eq!((info.count, info.path_count, found.len()), (0, 0, 0));
}

#[test]
fn paths_that_find_nothing_end() {
    let Some(gpu) = device() else { return };
    // A lamp that shines away from all there is.
    let lit = &Lit::new(gpu, "cornell", "with a light outside", |scene| {
        darken(scene);
        scene.lights.push(manylight_scene::Light::Spot {
            position: Vec3::new(0.0, 10.0, 0.0),
            direction: Vec3::Y,
            intensity: Vec3::ONE,
            cos_outer: 0.9,
            cos_inner: 0.95,
        });
    });
    let Lit { world, emitters, .. } = lit;
    let expected = trace(world, emitters, 100, 3, SEED, true);
    let (info, _) = traced(gpu, lit, 100, 3);
    assert_eq!((info.count, info.missing), (0, 0));
    assert_eq!(u64::from(info.path_count), expected.path_count);
}

fn on_emitters(gpu: &Gpu, scene: &GpuWorld, count: u32) -> (VplInfo, Vec<VplRecord>) {
    let tracer = EmitterTracer::new(gpu, count).expect("tracer");
    let vpls = GpuVpls::new(gpu, count, 1).expect("room");
    let mut rec = gpu.record(Some(scene.group()));
    tracer.record(&mut rec, SEED, &vpls);
    rec.submit().wait().expect("done");
    read(gpu, &vpls)
}

#[test]
fn lights_on_emitters_are_those_of_the_processor() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        let Lit { world, emitters, .. } = lit;
        for count in [1, 2500] {
            let expected: VplSet = trace_emitters(world, emitters, count, SEED);
            let (info, found) = on_emitters(gpu, &lit.scene, count);
            let name = format!("{}, {count} lights", lit.name);
            assert_eq!(info.count as usize, expected.lights.len(), "{name}");
            assert_eq!(u64::from(info.path_count), expected.path_count, "{name}");
            assert_agrees(world, &expected.lights, &found);
        }
    }
}

#[test]
fn lights_on_an_emitter_with_holes_keep_their_order() {
    let Some(gpu) = device() else { return };
    let lit = &holey_lamp(gpu);
    let Lit { world, emitters, .. } = lit;
    let expected = trace_emitters(world, emitters, 5000, SEED).lights;
    assert!(expected.len() > 1000 && expected.len() < 4000, "{}", expected.len());
    let (_, found) = on_emitters(gpu, &lit.scene, 5000);
    assert_eq!(found.len(), expected.len());
    assert_agrees(world, &expected, &found);
}

/// The Cornell box with a lamp of which half the texels are cut out.
fn holey_lamp(gpu: &Gpu) -> Lit {
    use manylight_scene::{AlphaMode, TextureImage, TextureSlot, Wrap};
    Lit::new(gpu, "cornell", "with a lamp with holes", |scene| {
        let texel = |i: u32| [255, 255, 255, if (i / 4 + i).is_multiple_of(2) { 255 } else { 0 }];
        scene.images.push(TextureImage {
            name: "holes".to_owned(),
            width: 4,
            height: 4,
            texels: (0..16).map(texel).collect(),
        });
        let lamp = scene.materials.iter().position(|m| m.name == "lamp").expect("a lamp");
        scene.materials[lamp].alpha_mode = AlphaMode::Mask(0.5);
        scene.materials[lamp].base_color_texture = Some(TextureSlot {
            image: scene.images.len() as u32 - 1,
            uv_set: 0,
            transform: glam::Affine2::IDENTITY,
            wrap: [Wrap::Repeat; 2],
            linear_filter: false,
        });
        for mesh in scene.meshes.iter_mut().filter(|m| m.material == lamp as u32) {
            let at = |p: &Vec3| glam::Vec2::new(p.x, p.z) * 3.0;
            mesh.uvs[0] = mesh.positions.iter().map(at).collect();
        }
    })
}

use super::testing::{self, Lit, Probe, ProbeParams, agree, scenes};
use super::*;
use crate::gpu::Gpu;
use crate::gpu::testing::{check_kernel, device};
use crate::math::{Sequence, uniform_sphere};

const SEED: u32 = 12;
const POINTS: u32 = 4096;

#[test]
fn kernels_match_their_shaders() {
    KERNELS.iter().chain(testing::KERNELS).for_each(|kernel| check_kernel(kernel));
}

fn probe(gpu: &Gpu, lit: &Lit) -> Vec<[f32; 48]> {
    let found = gpu.buffer("found", POINTS as usize).expect("buffer");
    let mut rec = gpu.record(Some(lit.scene.group()));
    let params = rec.uniform(&ProbeParams { count: POINTS, seed: SEED });
    rec.dispatch_items(&Probe { params, found: &found }, POINTS as usize);
    rec.submit().wait().expect("done");
    gpu.read(&found, POINTS as usize).expect("read")
}

/// Vector and number `i` of a record.
fn part(record: &[f32; 48], i: usize) -> (Vec3, f32) {
    (Vec3::from_slice(&record[4 * i..]), record[4 * i + 3])
}

#[test]
fn the_same_sources_are_drawn() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        let emitters = &lit.emitters;
        for (i, record) in probe(gpu, lit).iter().enumerate() {
            let u = Sequence::new(SEED, i as u32).next_2d()[0];
            let source = emitters.by_flux.sample(u).expect("not dark");
            assert_eq!(record[44], source as f32, "{}, point {i}", lit.name);
            if let Some(triangle) = emitters.surface.by_flux.sample(u) {
                assert_eq!(record[45], triangle as f32, "{}, point {i}", lit.name);
            }
        }
    }
}

#[test]
fn rays_leave_the_sources_as_on_the_processor() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        let Lit { world, emitters, .. } = lit;
        let mut different = 0;
        for (i, record) in probe(gpu, lit).iter().enumerate() {
            let expected = emitters.emit(world, &mut Sequence::new(SEED, i as u32));
            let (origin, found) = part(record, 0);
            assert_eq!(found == 1.0, expected.is_some(), "{}, point {i}", lit.name);
            let Some(ray) = expected else { continue };
            let same = agree(ray.origin, origin, world.diagonal())
                && agree(ray.direction, part(record, 1).0, 1.0)
                && agree(ray.flux, part(record, 2).0, 0.0);
            different += usize::from(!same);
        }
        assert!(different <= 2, "{}: {different} rays", lit.name);
    }
}

#[test]
fn points_on_emitters_agree() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        let Lit { world, emitters, .. } = lit;
        for (i, record) in probe(gpu, lit).iter().enumerate() {
            let mut sequence = Sequence::new(SEED, i as u32);
            let (choose, u) = (sequence.next_2d()[0], sequence.next_2d());
            let expected = emitters.surface.sample(world, choose, u);
            let (position, found) = part(record, 3);
            assert_eq!(found == 1.0, expected.is_some(), "{}, point {i}", lit.name);
            let Some(s) = expected else { continue };
            let ((normal, pdf_area), (radiance, sided)) = (part(record, 4), part(record, 5));
            assert!(agree(s.position, position, world.diagonal()), "{s:?} {position}");
            assert!(agree(s.normal, normal, 1.0) && agree(s.radiance, radiance, 0.0), "{s:?}");
            assert!((s.pdf_area / pdf_area - 1.0).abs() < 1e-5, "{s:?} {pdf_area}");
            assert_eq!(sided == 1.0, s.double_sided);
        }
    }
}

#[test]
fn lights_give_a_point_the_same() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        let Lit { world, emitters, .. } = lit;
        if emitters.lights.is_empty() {
            continue;
        }
        let [low, high] = world.bounds;
        let mut given = 0;
        for (i, record) in probe(gpu, lit).iter().enumerate() {
            let mut sequence = Sequence::new(SEED, i as u32);
            let ([_, z], [x, y]) = (sequence.next_2d(), sequence.next_2d());
            let p = low + (high - low) * Vec3::new(x, y, z);
            let expected = emitters.direct(i % emitters.lights.len(), p);
            let ((direction, distance), (irradiance, found)) = (part(record, 9), part(record, 10));
            let Some(s) = expected else {
                // At the very edge of a cone either side may give nothing.
                assert!(found == 0.0 || irradiance.length() < 1e-6, "{i} {irradiance}");
                continue;
            };
            given += 1;
            let near = if s.distance.is_finite() { s.distance } else { f32::MAX };
            assert!(agree(s.irradiance, irradiance, 1e-2), "{}: {s:?} {irradiance}", lit.name);
            assert!(agree(s.direction, direction, 1.0), "{}: {s:?} {direction}", lit.name);
            assert!((near / distance - 1.0).abs() < 1e-5, "{}: {s:?} {distance}", lit.name);
        }
        assert!(given > 500, "{}: {given}", lit.name);
    }
}

#[test]
fn directions_of_the_sky_agree() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        let Some(sky) = &lit.emitters.sky else { continue };
        let (mut drawn, mut looked_up) = (0, 0);
        for (i, record) in probe(gpu, lit).iter().enumerate() {
            let mut sequence = Sequence::new(SEED, i as u32);
            let (u, v) = (sequence.next_2d(), sequence.next_2d());
            let (direction, radiance, pdf_sa) = sky.sample(u);
            let ((found, density), (bright, density_there)) = (part(record, 6), part(record, 7));
            let same = agree(direction, found, 1.0)
                && radiance == bright
                && (density / pdf_sa - 1.0).abs() < 1e-4;
            drawn += usize::from(!same);
            let is_same = (density_there / sky.pdf_sa(direction) - 1.0).abs() < 1e-4;
            let there = sky.radiance(uniform_sphere(v));
            looked_up += usize::from(!is_same || there != part(record, 8).0);
        }
        // Thresholds have 32 bits: in a dim texel they place a direction less well.
        assert!(drawn <= 4, "{}: {drawn} draws", lit.name);
        assert!(looked_up <= 20, "{}: {looked_up} look-ups", lit.name);
    }
}

#[test]
fn a_dark_scene_draws_nothing() {
    let Some(gpu) = device() else { return };
    let shot = manylight_scene::builtin("cornell").expect("cornell");
    let mut scene = shot.scene;
    super::testing::darken(&mut scene);
    let world = World::new(scene).expect("world");
    let emitters = Emitters::new(&world);
    let words = pack(&world, &emitters);
    let scene = crate::world::gpu::GpuWorld::new(gpu, &world, &words).expect("scene");
    let found = gpu.buffer("found", 64).expect("buffer");
    let mut rec = gpu.record(Some(scene.group()));
    let params = rec.uniform(&ProbeParams { count: 64, seed: 1 });
    rec.dispatch_items(&Probe { params, found: &found }, 64);
    rec.submit().wait().expect("done");
    for record in gpu.read::<[f32; 48]>(&found, 64).expect("read") {
        assert_eq!([record[3], record[15], record[43]], [0.0; 3]);
        assert_eq!(part(&record, 8).0, Vec3::ZERO);
    }
}

#[test]
fn a_large_map_of_the_sky_fits_the_smallest_limits() {
    let (world, emitters) = {
        let mut scene = manylight_scene::builtin("cornell").expect("cornell").scene;
        scene.sky = Some(testing::sky_map());
        let world = World::new(scene).expect("world");
        let emitters = Emitters::new(&world);
        (world, emitters)
    };
    let Some(Sky::Map(map)) = &world.scene.sky else { panic!("a map") };
    let lists = pack(&world, &emitters);
    assert_eq!(lists.sky.size, [map.width, map.height]);
    assert_eq!(lists.sky.texels.len(), map.radiance.len());
    // In the list are two words a row; all else is in the texture.
    let mut without = world.scene.clone();
    without.sky = None;
    let without = World::new(without).expect("world");
    let rest = pack(&without, &Emitters::new(&without)).words.len();
    assert_eq!(lists.words.len(), rest + 2 * map.height as usize + 1);
    // So that the list of a map of 8192 × 4096 is this long.
    let limits = wgpu::Limits::defaults();
    assert!(4 * (rest as u64 + 2 * 4096 + 1) < limits.max_storage_buffer_binding_size / 1000);
    assert!(8192 <= limits.max_texture_dimension_2d);
}

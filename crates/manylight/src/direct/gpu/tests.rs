use super::*;
use crate::direct::{from_lights, from_sky};
use crate::emitter::gpu::testing::{Lit, agree, scenes};
use crate::gather::Gathered;
use crate::gpu::Gpu;
use crate::gpu::testing::{check_kernel, device};
use crate::math::{Sequence, hash_u32, morton_2d};
use crate::surface::Receivers;
use glam::Vec3;
use manylight_scene::Sky;

const SIZE: [usize; 2] = [37, 24];
const PIXELS: usize = SIZE[0] * SIZE[1];
const SEED: u32 = 21;

#[test]
fn kernels_match_their_shaders() {
    KERNELS.iter().for_each(|kernel| check_kernel(kernel));
}

/// Pixels that differ by more than rounding, and the relative difference of all together.
fn compare(expected: &[Vec3], found: &[[f32; 4]]) -> (usize, f64) {
    let (mut different, mut sums) = (0, [0.0f64; 2]);
    for (a, &[x, y, z, _]) in expected.iter().zip(found) {
        let b = Vec3::new(x, y, z);
        different += usize::from(!agree(*a, b, 1e-6));
        sums[0] += f64::from(a.element_sum());
        sums[1] += f64::from(b.element_sum());
    }
    (different, (sums[1] / sums[0].max(1e-9) - 1.0).abs())
}

#[test]
fn lights_give_receivers_what_they_give_on_the_processor() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        let Lit { world, emitters, .. } = lit;
        if emitters.lights.is_empty() {
            continue;
        }
        let (receivers, planes) = lit.receivers(gpu, SIZE);
        let at = |i: usize| {
            let Some(surface) = &receivers.samples[i].surface else { return Vec3::ZERO };
            let mut sequence = Sequence::new(hash_u32(SEED ^ hash_u32(i as u32)), 0);
            from_lights(world, emitters, surface, &mut sequence)
        };
        let expected: Vec<Vec3> = (0..PIXELS).map(at).collect();
        let run = || {
            let irradiance = gpu.buffer("irradiance", PIXELS).expect("buffer");
            let mut rec = gpu.record(Some(lit.scene.group()));
            record_lights(&mut rec, &planes, SEED, &irradiance);
            rec.submit().wait().expect("done");
            gpu.read(&irradiance, PIXELS).expect("read")
        };
        let found = run();
        let (different, _) = compare(&expected, &found);
        assert!(expected.iter().any(|e| *e != Vec3::ZERO), "{}", lit.name);
        assert!(different <= 4, "{}: {different} of {PIXELS} pixels", lit.name);
        assert_eq!(run(), found, "{}", lit.name);
    }
}

fn sky_on_processor(lit: &Lit, receivers: &Receivers, rays: u32) -> Gathered {
    let Lit { world, emitters, .. } = lit;
    let sky = emitters.sky.as_ref().expect("a sky");
    let is_constant = matches!(world.scene.sky, Some(Sky::Constant(_)));
    let at = |i: usize| {
        let surface = receivers.samples[i].surface.as_ref()?;
        let first = morton_2d((i % SIZE[0]) as u32, (i / SIZE[0]) as u32).wrapping_mul(rays);
        let sequences = (0..rays).map(|ray| Sequence::new(SEED, first.wrapping_add(ray)));
        Some(from_sky(world, sky, surface, sequences, is_constant))
    };
    let mut gathered = Gathered::dark(PIXELS);
    gathered.set_exact((0..PIXELS).map(|i| at(i).unwrap_or_default()));
    gathered
}

type Planes = (Vec<[f32; 4]>, Vec<[f32; 2]>);

fn sky_on_device(gpu: &Gpu, lit: &Lit, planes: &GpuReceivers, rays: u32, exact: bool) -> Planes {
    let unshadowed = gpu.buffer("unshadowed", PIXELS).expect("buffer");
    let ratios = gpu.buffer("ratios", PIXELS).expect("buffer");
    let mut rec = gpu.record(Some(lit.scene.group()));
    let sky = SkyRays { rays, seed: SEED, exact };
    record_sky(&mut rec, planes, sky, &unshadowed, &ratios);
    rec.submit().wait().expect("done");
    (gpu.read(&unshadowed, PIXELS).expect("read"), gpu.read(&ratios, PIXELS).expect("read"))
}

#[test]
fn the_sky_in_pieces_is_the_sky() {
    let Some(gpu) = device() else { return };
    let lit = scenes(gpu).iter().find(|lit| lit.emitters.sky.is_some()).expect("a sky");
    let (_, planes) = lit.receivers(gpu, SIZE);
    let sky = SkyRays { rays: 5, seed: SEED, exact: true };
    let expected = sky_on_device(gpu, lit, &planes, sky.rays, sky.exact);
    let unshadowed = gpu.buffer("unshadowed", PIXELS).expect("buffer");
    let ratios = gpu.buffer("ratios", PIXELS).expect("buffer");
    let read = || {
        let light = gpu.read(&unshadowed, PIXELS).expect("read");
        (light, gpu.read(&ratios, PIXELS).expect("read"))
    };
    let mut rec = gpu.record(Some(lit.scene.group()));
    for part in [300..PIXELS, 0..299, 299..300] {
        record_sky_part(&mut rec, &planes, sky, (&unshadowed, &ratios), part);
    }
    rec.submit().wait().expect("done");
    assert!(read() == expected);
    gpu.write(&unshadowed, &vec![[9.0; 4]; PIXELS]);
    let told = std::cell::RefCell::new(Vec::new());
    let tick = |share: f64| told.borrow_mut().push(share);
    let lists = (&unshadowed, &ratios);
    trace_sky(gpu, lit.scene.group(), &planes, sky, lists, &tick).expect("traced");
    assert!(read() == expected);
    assert_eq!(told.borrow().last(), Some(&1.0));
}

#[test]
fn the_sky_gives_receivers_what_it_gives_on_the_processor() {
    let Some(gpu) = device() else { return };
    for lit in scenes(gpu) {
        if lit.emitters.sky.is_none() {
            continue;
        }
        let (receivers, planes) = lit.receivers(gpu, SIZE);
        for rays in [2, 7] {
            let expected = sky_on_processor(lit, &receivers, rays);
            let (unshadowed, ratios) = sky_on_device(gpu, lit, &planes, rays, false);
            let (different, _) = compare(&expected.unshadowed, &unshadowed);
            let off = |(a, b): (&f32, &[f32; 2])| (a - b[0]).abs() > 1e-4 || b[1] != 1.0;
            let ratios_off = expected.shadow_ratio.iter().zip(&ratios).filter(|r| off(*r)).count();
            let name = format!("{}, {rays} rays", lit.name);
            assert!(different <= 4, "{name}: {different} of {PIXELS} sums");
            assert!(ratios_off <= 8, "{name}: {ratios_off} of {PIXELS} ratios");

            let (arriving, ratios) = sky_on_device(gpu, lit, &planes, rays, true);
            let (different, mean) = compare(&expected.shadowed, &arriving);
            assert!(different <= 8, "{name}: {different} of {PIXELS} arriving sums");
            assert!(mean < 1e-3, "{name}: {mean}");
            assert!(ratios.iter().all(|r| *r == [1.0, 1.0]));
        }
        assert_eq!(
            sky_on_device(gpu, lit, &planes, 2, false),
            sky_on_device(gpu, lit, &planes, 2, false)
        );
    }
}

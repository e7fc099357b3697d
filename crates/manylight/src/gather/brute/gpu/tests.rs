use super::*;
use crate::emitter::gpu::testing::{Lit, agree, scenes};
use crate::gather::brute;
use crate::gpu::testing::{check_kernel, device};
use crate::surface::Receivers;
use crate::vlight::vpl::gpu::GpuVpls;
use crate::vlight::vpl::{Vpl, trace};
use glam::Vec3;

const SIZE: [usize; 2] = [17, 12];
const PIXELS: usize = SIZE[0] * SIZE[1];

#[test]
fn kernels_match_their_shaders() {
    KERNELS.iter().for_each(|kernel| check_kernel(kernel));
}

struct Found {
    unshadowed: Vec<[f32; 4]>,
    shadowed: Vec<[f32; 4]>,
    ratios: Vec<[f32; 2]>,
}

fn gathered(gpu: &Gpu, lit: &Lit, planes: &GpuReceivers, lights: &[Vpl], d_min: f32) -> Found {
    let vpls = GpuVpls::upload(gpu, lights, 1).expect("lights");
    let sums = GpuBrute::new(gpu, PIXELS).expect("room");
    let list = (&vpls.lights, lights.len());
    let last = std::cell::Cell::new(0.0);
    let progress = |share: f64| {
        assert!(share >= last.get() && share <= 1.0);
        last.set(share);
    };
    sums.gather(gpu, lit.scene.group(), planes, list, d_min, &progress).expect("gathered");
    assert_eq!(last.get(), 1.0);
    Found {
        unshadowed: gpu.read(&sums.unshadowed, PIXELS).expect("read"),
        shadowed: gpu.read(&sums.shadowed, PIXELS).expect("read"),
        ratios: gpu.read(&sums.ratios, PIXELS).expect("read"),
    }
}

fn three([x, y, z, _]: [f32; 4]) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Compares all planes with the processor's sums.
fn assert_agrees(lit: &Lit, receivers: &Receivers, lights: &[Vpl], d_min: f32, found: &Found) {
    let (mut off, mut evals_off, mut brightest) = (0, 0, 0.0f32);
    for (i, sample) in receivers.samples.iter().enumerate() {
        let sum = match &sample.surface {
            Some(surface) => brute::sum(&lit.world, surface, lights, d_min),
            None => brute::BruteSum::default(),
        };
        brightest = brightest.max(sum.unshadowed.max_element());
        let unshadowed = three(found.unshadowed[i]);
        assert!(agree(sum.unshadowed, unshadowed, 0.0), "{}: {sum:?} {unshadowed}", lit.name);
        // Rays at the edge of something decide for a light or two.
        let edge = 2.0 * sum.unshadowed.length() / sum.evals.max(1) as f32;
        let shadowed = three(found.shadowed[i]);
        let distance = (sum.shadowed - shadowed).length();
        assert!(distance <= 1e-4 * sum.shadowed.length() + 8.0 * edge, "{}: {i}", lit.name);
        off += usize::from(!agree(sum.shadowed, shadowed, 1e-6));
        evals_off += usize::from(found.unshadowed[i][3] != sum.evals as f32);
        let [ratio, trust] = found.ratios[i];
        let exact = match unshadowed == Vec3::ZERO {
            true => 1.0,
            false => crate::math::luminance(shadowed) / crate::math::luminance(unshadowed),
        };
        assert!((ratio - exact).abs() < 1e-5 && trust == 1.0, "{ratio} {exact} {trust}");
    }
    assert!(brightest > 0.0, "{}", lit.name);
    assert!(off * 100 <= PIXELS, "{}: {off} of {PIXELS} shadowed sums", lit.name);
    assert!(evals_off * 100 <= PIXELS, "{}: {evals_off} counts", lit.name);
}

#[test]
fn sums_are_those_of_the_processor() {
    let Some(gpu) = device() else { return };
    for lit in [&scenes(gpu)[0], &scenes(gpu)[6]] {
        let Lit { world, emitters, .. } = lit;
        let (receivers, planes) = lit.receivers(gpu, SIZE);
        // More than all loops of an invocation have turns for on a driver that ends them early.
        let lights = trace(world, emitters, 5000, 3, 8, true).lights;
        let found = gathered(gpu, lit, &planes, &lights, 0.1);
        assert_agrees(lit, &receivers, &lights, 0.1, &found);
        let again = gathered(gpu, lit, &planes, &lights, 0.1);
        assert_eq!((again.unshadowed, again.shadowed), (found.unshadowed, found.shadowed));
    }
}

#[test]
fn no_light_and_one_light() {
    let Some(gpu) = device() else { return };
    let lit = &scenes(gpu)[0];
    let (receivers, planes) = lit.receivers(gpu, SIZE);
    let found = gathered(gpu, lit, &planes, &[], 0.1);
    assert!(found.unshadowed.iter().chain(&found.shadowed).all(|e| *e == [0.0; 4]));
    assert!(found.ratios.iter().all(|r| *r == [1.0, 1.0]));
    let light =
        Vpl { position: Vec3::new(0.0, 1.9, 0.0), normal: Vec3::NEG_Y, intensity: Vec3::ONE };
    let found = gathered(gpu, lit, &planes, &[light], 0.1);
    let all: f32 = found.shadowed.iter().map(|e| e[0]).sum();
    let expected: f32 = receivers
        .samples
        .iter()
        .filter_map(|s| s.surface.as_ref())
        .map(|s| brute::sum(&lit.world, s, &[light], 0.1).shadowed.x)
        .sum();
    assert!((all / expected - 1.0).abs() < 2e-3, "{all} {expected}");
}

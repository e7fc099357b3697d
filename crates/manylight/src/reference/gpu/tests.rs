use super::*;
use crate::emitter::gpu::testing::{Lit, scenes};
use crate::gpu::testing::{check_kernel, device};
use crate::math::{Sequence, hash_u32};
use crate::reference::PathTracer;
use glam::{DVec3, Vec3};

const SIZE: [usize; 2] = [16, 11];
const PIXELS: usize = SIZE[0] * SIZE[1];
const SEED: u32 = 30;

#[test]
fn kernels_match_their_shaders() {
    KERNELS.iter().for_each(|kernel| check_kernel(kernel));
}

fn on_processor(lit: &Lit, view: &ViewFrame, paths: &Paths) -> Vec<[Vec3; 3]> {
    let Lit { world, emitters, .. } = lit;
    let Paths { bounces, normal_maps, .. } = *paths;
    let tracer = PathTracer { world, emitters, bounces, normal_maps };
    let pixel = |i: usize| {
        let seed = hash_u32(paths.seed ^ hash_u32(i as u32 ^ PIXEL_KEY));
        let mut sums = [DVec3::ZERO; 3];
        for s in 0..paths.spp {
            let (x, y) = (i % view.width, i / view.width);
            let path = tracer.trace(view, x, y, Sequence::new(seed, s));
            for (sum, part) in sums.iter_mut().zip([path.emission, path.direct, path.indirect]) {
                *sum += part.as_dvec3();
            }
        }
        sums.map(|s| (s / f64::from(paths.spp)).as_vec3())
    };
    (0..PIXELS).map(pixel).collect()
}

fn on_device(gpu: &Gpu, lit: &Lit, view: &ViewFrame, paths: &Paths) -> [Vec<[f32; 4]>; 3] {
    let found = GpuPaths::new(gpu, PIXELS).expect("room");
    found.trace(gpu, lit.scene.group(), view, paths, &|_| ()).expect("traced");
    [&found.emission, &found.direct, &found.indirect]
        .map(|plane| gpu.read(plane, PIXELS).expect("read"))
}

/// Pixels of which a part differs by more than 1e-3, and the difference of the means of each part.
fn compare(expected: &[[Vec3; 3]], found: &[Vec<[f32; 4]>; 3]) -> (usize, [f64; 3]) {
    let (mut different, mut sums) = (0, [[0.0f64; 2]; 3]);
    for (i, parts) in expected.iter().enumerate() {
        let mut same = true;
        for (k, a) in parts.iter().enumerate() {
            let [x, y, z, _] = found[k][i];
            let b = Vec3::new(x, y, z);
            same &= (*a - b).length() <= 1e-3 * a.length() + 1e-6;
            sums[k][0] += f64::from(a.element_sum());
            sums[k][1] += f64::from(b.element_sum());
        }
        different += usize::from(!same);
    }
    (different, sums.map(|[a, b]| (a - b).abs() / a.max(1e-9)))
}

#[test]
fn paths_are_those_of_the_processor() {
    let Some(gpu) = device() else { return };
    // A lamp, an even sky, everything at once, a sun through a roof.
    for lit in [0, 2, 5, 6].map(|i| &scenes(gpu)[i]) {
        let view = ViewFrame::new(&lit.camera, SIZE[0], SIZE[1]);
        let paths = Paths { spp: 3, bounces: 3, normal_maps: true, seed: SEED };
        let expected = on_processor(lit, &view, &paths);
        let found = on_device(gpu, lit, &view, &paths);
        let (different, off) = compare(&expected, &found);
        assert!(different * 100 <= PIXELS, "{}: {different} of {PIXELS} pixels", lit.name);
        assert!(off.iter().all(|&o| o < 1e-3), "{}: {off:?}", lit.name);
    }
}

#[test]
fn many_samples_and_any_number_of_bounces() {
    let Some(gpu) = device() else { return };
    let lit = &scenes(gpu)[5];
    let view = ViewFrame::new(&lit.camera, SIZE[0], SIZE[1]);
    // More than a block of samples; direct light alone; deep paths.
    for (spp, bounces) in [(BLOCK + 3, 1), (1, 0), (1, 8)] {
        let paths = Paths { spp, bounces, normal_maps: true, seed: SEED };
        let expected = on_processor(lit, &view, &paths);
        let found = on_device(gpu, lit, &view, &paths);
        let (_, off) = compare(&expected, &found);
        assert!(off.iter().all(|&o| o < 1e-3), "{spp} samples, {bounces} bounces: {off:?}");
    }
    let paths = Paths { spp: BLOCK + 3, bounces: 1, normal_maps: true, seed: SEED };
    assert_eq!(on_device(gpu, lit, &view, &paths), on_device(gpu, lit, &view, &paths));
}

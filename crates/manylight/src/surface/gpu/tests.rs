use super::*;
use crate::gpu::testing::{check_kernel, device};
use crate::math::{Sequence, uniform_sphere};
use crate::world::World;
use crate::world::gpu::{GpuWorld, SourceLists};

#[test]
fn kernels_match_their_shaders() {
    KERNELS.iter().copied().flatten().for_each(|kernel| check_kernel(kernel));
}

#[test]
fn packed_normals_come_back() {
    for i in 0..5000 {
        let n = uniform_sphere(Sequence::new(2, i).next_2d());
        let back = unpack_octahedral(pack_octahedral(n));
        assert!((back - n).length() < 7e-5, "{n} {back}");
        assert_eq!(pack_octahedral(back), pack_octahedral(n));
    }
    for n in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        assert!((unpack_octahedral(pack_octahedral(n)) - n).length() < 1e-6, "{n}");
    }
}

/// Shots that every checkout has, and real ones where they are found.
fn shots() -> Vec<manylight_scene::Shot> {
    let mut names = vec!["builtin:cornell".to_owned(), "builtin:atrium".to_owned()];
    let textured = manylight_testing::scenes().map(|f| f.join("shots/animated_stage-main.json"));
    names.extend(textured.map(|path| path.display().to_string()));
    names.iter().map(|name| manylight_scene::load(name).expect("shot")).collect()
}

#[test]
fn receivers_agree() {
    let Some(gpu) = device() else { return };
    for shot in shots() {
        let (width, height) = (61, 40);
        let view = ViewFrame::new(&shot.camera, width, height);
        let world = World::new(shot.scene).expect("world");
        let name = &world.scene.name;
        let scene = GpuWorld::new(gpu, &world, &SourceLists::default()).expect("world");
        let planes = GpuReceivers::new(gpu, width, height).expect("receivers");
        let offset_px = Vec2::splat(0.5);
        let mut rec = gpu.record(Some(scene.group()));
        planes.trace(&mut rec, &view, offset_px, true);
        rec.submit().wait().expect("done");
        let found = planes.download(gpu, &view, offset_px).expect("receivers");
        let expected = Receivers::trace(&world, &view, offset_px, true);
        let mut different = 0;
        for (a, b) in expected.samples.iter().zip(&found.samples) {
            let (Some(a), Some(b)) = (&a.surface, &b.surface) else {
                different += usize::from(a.surface.is_some() != b.surface.is_some());
                continue;
            };
            let scale = world.diagonal() * 1e-5;
            let same = (a.position - b.position).length() < scale
                && (a.ng - b.ng).length() < 1e-4
                && (a.ns - b.ns).length() < 1e-3
                && (a.albedo - b.albedo).abs().max_element() < 1e-3
                && (a.emission - b.emission).length() <= 1e-3 * a.emission.length();
            different += usize::from(!same);
        }
        assert!(different <= 3, "{name}: {different} of {} pixels", width * height);
    }
}

#[test]
fn receivers_survive_the_way_to_the_device_and_back() {
    let Some(gpu) = device() else { return };
    let shot = manylight_scene::load("builtin:atrium").expect("shot");
    let view = ViewFrame::new(&shot.camera, 16, 9);
    let world = World::new(shot.scene).expect("world");
    let receivers = Receivers::trace(&world, &view, Vec2::splat(0.5), true);
    let planes = GpuReceivers::upload(gpu, &receivers, |_| Vec3::ONE).expect("upload");
    let back = planes.download(gpu, &view, Vec2::splat(0.5)).expect("download");
    for (a, b) in receivers.samples.iter().zip(&back.samples) {
        assert_eq!((a.direction, a.depth), (b.direction, b.depth));
        let (Some(a), Some(b)) = (&a.surface, &b.surface) else { continue };
        assert_eq!((a.position, a.ns, a.albedo), (b.position, b.ns, b.albedo));
        assert!((a.ng - b.ng).length() < 7e-5);
    }
}

//! Scenes with every kind of source, on processor and device.

use crate::bvh;
use crate::emitter::Emitters;
use crate::emitter::gpu::{CONSTANTS, pack};
use crate::gpu::{GROUP, Gpu, KernelInfo, kernel, record};
use crate::math::hash_u32;
use crate::surface::gpu::GpuReceivers;
use crate::surface::{Receivers, ViewFrame};
use crate::world::gpu::GpuWorld;
use crate::world::{self, World};
use glam::{Vec2, Vec3};
use manylight_scene::{Camera, Light, Scene, Sky, SkyMap};
use std::sync::OnceLock;

record! {
    /// What [`Probe`] needs to know.
    pub struct ProbeParams {
        /// Points.
        pub count: u32,
        /// Of their sequence.
        pub seed: u32,
    }
}

kernel! {
    /// Everything that is drawn from the sources at points of a sequence, for comparison.
    pub struct Probe = "emitter/probe", [GROUP, 1, 1], scene,
        [CONSTANTS, world::gpu::CONSTANTS, bvh::gpu::CONSTANTS];
    uniform params: ProbeParams, write found: [f32; 48]
}

/// Every kernel of this file.
pub(crate) const KERNELS: &[&KernelInfo] = &[&Probe::INFO];

/// A scene on both sides.
pub(crate) struct Lit {
    pub name: String,
    pub world: World,
    pub emitters: Emitters,
    pub camera: Camera,
    pub scene: GpuWorld,
}

impl Lit {
    /// A builtin scene, changed.
    pub fn new(gpu: &Gpu, builtin: &str, name: &str, change: impl FnOnce(&mut Scene)) -> Self {
        let mut shot = manylight_scene::builtin(builtin).expect("builtin");
        change(&mut shot.scene);
        let world = World::new(shot.scene).expect("scene");
        let emitters = Emitters::new(&world);
        let scene = GpuWorld::new(gpu, &world, &pack(&world, &emitters)).expect("world");
        let (name, camera) = (format!("{builtin} {name}"), shot.camera);
        Self { name, world, emitters, camera, scene }
    }

    /// Receivers on both sides, the same.
    pub fn receivers(&self, gpu: &Gpu, size: [usize; 2]) -> (Receivers, GpuReceivers) {
        let view = ViewFrame::new(&self.camera, size[0], size[1]);
        let receivers = Receivers::trace(&self.world, &view, Vec2::splat(0.5), true);
        let planes = GpuReceivers::upload(gpu, &receivers, |_| Vec3::ZERO).expect("receivers");
        (receivers, planes)
    }
}

/// Puts out all lamps.
pub(crate) fn darken(scene: &mut Scene) {
    scene.materials.iter_mut().for_each(|m| m.emission = Vec3::ZERO);
    scene.lights.clear();
    scene.sky = None;
}

/// A map that is dark below the horizon and in some columns, with a small bright sun.
pub(crate) fn sky_map() -> Sky {
    let (width, height) = (32, 16);
    let texel = |i: u32| {
        let (x, y) = (i % width, i / width);
        let noise = (hash_u32(i) % 100) as f32 * 0.01;
        match (x, y) {
            (5, 4) => Vec3::new(300.0, 280.0, 200.0),
            _ if y >= 8 || x % 7 == 0 => Vec3::ZERO,
            _ => Vec3::new(0.5, 0.7, 1.0) * noise,
        }
    };
    let radiance = (0..width * height).map(texel).collect();
    Sky::Map(SkyMap { width, height, radiance, rotation_rad: 0.7 })
}

/// Punctual lights in the Cornell box: `count` of all kinds.
pub(crate) fn add_lights(scene: &mut Scene, count: u32) {
    let light = |i: u32| {
        let at = |k: u32| (hash_u32(8 * i + k) % 1000) as f32 * 0.001;
        let position = Vec3::new(at(0) * 1.6 - 0.8, 0.9 + at(1), at(2) * 1.6 - 0.8);
        let intensity = Vec3::new(0.2 + at(3), 0.3 + at(4), 0.1 + at(5));
        let direction = Vec3::new(at(6) - 0.5, -1.0, at(7) - 0.5).normalize();
        match i % 3 {
            0 => Light::Spot { position, direction, intensity, cos_outer: 0.6, cos_inner: 0.8 },
            1 => Light::Point { position, intensity },
            _ => Light::Sun { direction: -Vec3::Z, irradiance: intensity * 0.2 },
        }
    };
    scene.lights.extend((0..count).map(light));
}

/// Scenes with every kind of source; the sun of the atrium comes through its roof.
pub(crate) fn scenes(gpu: &'static Gpu) -> &'static [Lit] {
    static SCENES: OnceLock<Vec<Lit>> = OnceLock::new();
    SCENES.get_or_init(|| build_scenes(gpu))
}

fn build_scenes(gpu: &Gpu) -> Vec<Lit> {
    let two_sided = |scene: &mut Scene| {
        scene.materials.iter_mut().for_each(|m| m.double_sided = true);
    };
    vec![
        Lit::new(gpu, "cornell", "as it is", |_| ()),
        Lit::new(gpu, "cornell", "with a lamp that shines on both sides", two_sided),
        Lit::new(gpu, "cornell", "under an even sky", |scene| {
            darken(scene);
            scene.sky = Some(Sky::Constant(Vec3::new(0.4, 0.6, 1.0)));
        }),
        Lit::new(gpu, "cornell", "under a map of the sky", |scene| {
            darken(scene);
            scene.sky = Some(sky_map());
        }),
        Lit::new(gpu, "cornell", "with three lights", |scene| {
            darken(scene);
            add_lights(scene, 3);
        }),
        Lit::new(gpu, "cornell", "with everything", |scene| {
            add_lights(scene, 17);
            scene.sky = Some(sky_map());
        }),
        // Its sky would meet surfaces in one plane below the ground, where either may be right.
        Lit::new(gpu, "atrium", "with its sun alone", |scene| scene.sky = None),
        Lit::new(gpu, "many_lamps", "as it is", |_| ()),
    ]
}

/// Whether two vectors agree to 1e-4 of the expected one's length, or of `scale`.
pub(crate) fn agree(expected: Vec3, found: Vec3, scale: f32) -> bool {
    (expected - found).length() <= 1e-4 * expected.length().max(scale)
}

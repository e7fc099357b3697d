use super::*;
use crate::frame::Frame;
use crate::gpu::testing::device;
use crate::gpu::{Features, GpuOptions};
use glam::Vec3;
use manylight_scene::Scene;
use std::sync::{Mutex, MutexGuard, PoisonError};
use wgpu::TextureUsages;

mod kept;

/// Rows of 32 half texels are as long as a copy asks for.
const SIZE: [usize; 2] = [32, 20];
const USAGE: TextureUsages = TextureUsages::STORAGE_BINDING.union(TextureUsages::COPY_SRC);

/// A renderer on the device of the tests, as an engine would make it. One after another: they share
/// their pipelines, which software takes long to build.
struct Rented {
    renderer: Option<GpuRenderer>,
    camera: Camera,
    gpu: MutexGuard<'static, Option<Gpu>>,
}

impl Rented {
    /// The Cornell box, after `change`.
    fn new(change: impl FnOnce(&mut Scene)) -> Option<Self> {
        static GPU: Mutex<Option<Gpu>> = Mutex::new(None);
        let opened = device()?;
        let mut gpu = GPU.lock().unwrap_or_else(PoisonError::into_inner);
        let rented = gpu.take().unwrap_or_else(|| {
            let (device, queue) = (opened.device().clone(), opened.queue().clone());
            Gpu::from_device(device, queue, opened.name().to_owned(), Features::ALL)
                .expect("device")
        });
        let mut shot = manylight_scene::builtin("cornell").expect("builtin");
        change(&mut shot.scene);
        let renderer = Renderer::new(shot.scene).expect("scene");
        let renderer = Some(GpuRenderer::new(rented, renderer).expect("renderer"));
        Some(Self { renderer, camera: shot.camera, gpu })
    }

    fn renderer(&mut self) -> &mut GpuRenderer {
        self.renderer.as_mut().expect("until it is dropped")
    }

    fn render(&mut self, settings: &Settings, seed: u32) -> Frame {
        let camera = self.camera.clone();
        self.render_from(&camera, settings, seed)
    }

    fn render_from(&mut self, camera: &Camera, settings: &Settings, seed: u32) -> Frame {
        let settings = Settings { seed, ..settings.clone() };
        // With lights of its own, though those of the frame before were made the same way.
        self.renderer().buffers.iter_mut().for_each(Buffers::forget_lights);
        self.renderer().render(camera, SIZE, &settings, &|_, _| ()).expect("frame")
    }

    /// Records one traced frame into an encoder.
    fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &Camera,
        seed: u32,
        targets: &EngineTargets<'_>,
    ) {
        let (traced, settings) = (EngineReceivers::Traced, settings());
        let renderer = self.renderer();
        renderer.record_into(encoder, camera, &settings, seed, traced, targets).expect("frame");
    }

    fn submit(&mut self, encoder: wgpu::CommandEncoder) -> bool {
        let renderer = self.renderer();
        renderer.gpu().queue().submit([encoder.finish()]);
        renderer.gpu().wait().expect("done");
        renderer.after_submit().expect("looked")
    }

    fn target(&mut self) -> wgpu::TextureView {
        texture(self.renderer().gpu(), SIZE, USAGE)
    }

    fn encoder(&mut self) -> wgpu::CommandEncoder {
        self.renderer().gpu().device().create_command_encoder(&Default::default())
    }
}

impl Drop for Rented {
    fn drop(&mut self) {
        *self.gpu = self.renderer.take().map(|renderer| renderer.gpu);
    }
}

fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.vpls.count = 400;
    settings.vpls.emitter_count = 100;
    settings.grid.alpha = Some(0.7);
    settings.shadow.rays = 2;
    settings
}

fn texture(gpu: &Gpu, size: [usize; 2], usage: TextureUsages) -> wgpu::TextureView {
    let [width, height] = size.map(|n| n as u32);
    let texture = gpu.device().create_texture(&wgpu::TextureDescriptor {
        label: Some("target"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: STORE_FORMAT,
        usage,
        view_formats: &[],
    });
    texture.create_view(&Default::default())
}

fn composite(view: &wgpu::TextureView) -> EngineTargets<'_> {
    EngineTargets { composite: view, indirect: None, irradiance: None }
}

/// The texels of a texture.
fn read(gpu: &Gpu, view: &wgpu::TextureView) -> Vec<[f32; 4]> {
    let texels = gpu.buffer::<[u32; 2]>("texels", SIZE[0] * SIZE[1]).expect("buffer");
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        view.texture().as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: texels.raw(),
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(8 * SIZE[0] as u32),
                rows_per_image: None,
            },
        },
        view.texture().size(),
    );
    gpu.queue().submit([encoder.finish()]);
    let texels = gpu.read(&texels, texels.len()).expect("texels");
    let half = |bits: u32| {
        let (exponent, mantissa) = (bits >> 10 & 31, (bits & 1023) as f32 / 1024.0);
        let sign = if bits >> 15 & 1 == 1 { -1.0 } else { 1.0 };
        sign * match exponent {
            0 => mantissa * 2f32.powi(-14),
            31 => f32::INFINITY,
            _ => (1.0 + mantissa) * 2f32.powi(exponent as i32 - 15),
        }
    };
    let texel = |[a, b]: [u32; 2]| [a & 0xffff, a >> 16, b & 0xffff, b >> 16].map(half);
    texels.into_iter().map(texel).collect()
}

/// Whether texels are colors up to the rounding of half floats, to the nearest or towards zero.
fn assert_same(found: &[[f32; 4]], expected: &[Vec3], what: &str) {
    assert_close(found, expected, 1e-3, what);
}

/// Whether texels are colors up to a share of them.
fn assert_close(found: &[[f32; 4]], expected: &[Vec3], share: f32, what: &str) {
    assert_eq!(found.len(), expected.len());
    assert!(expected.iter().any(|c| c.max_element() > 0.0), "{what}: all dark");
    for (i, ([r, g, b, _], expected)) in found.iter().zip(expected).enumerate() {
        let difference = (Vec3::new(*r, *g, *b) - *expected).abs().max_element();
        let most = expected.max_element() * share + 1e-6;
        assert!(difference <= most, "{what}, pixel {i}: {r} {g} {b}, expected {expected}");
    }
}

fn lamp() -> Light {
    Light::Point { position: Vec3::new(0.3, 1.0, 0.2), intensity: Vec3::splat(0.4) }
}

/// Into the open side of the box.
fn sun() -> Light {
    Light::Sun { direction: -Vec3::Z, irradiance: Vec3::new(1.0, 0.9, 0.7) }
}

fn sky() -> Option<Sky> {
    Some(Sky::Constant(Vec3::new(0.2, 0.3, 0.5)))
}

/// Leaves one kind of source, which is soon gathered.
fn only_a_lamp(scene: &mut Scene) {
    scene.materials.iter_mut().for_each(|m| m.emission = Vec3::ZERO);
    scene.lights = vec![lamp()];
}

#[test]
fn frames_recorded_together_are_those_rendered_alone() {
    let under_the_sky = |scene: &mut Scene| {
        only_a_lamp(scene);
        scene.sky = sky();
    };
    let Some(mut rented) = Rented::new(under_the_sky) else { return };
    let camera = rented.camera.clone();
    let other = Camera { position: camera.position + Vec3::X * 0.2, ..camera.clone() };
    let settings = settings();
    let first = rented.render(&settings, 7);
    let second = rented.render_from(&other, &settings, 8);
    rented.renderer().set_lights(vec![sun()], sky()).expect("lights");
    let third = rented.render(&settings, 9);
    rented.renderer().set_lights(vec![lamp()], sky()).expect("lights");
    let views: Vec<_> = (0..5).map(|_| rented.target()).collect();
    let [indirect, irradiance] = [Some(&views[3]), Some(&views[4])];
    let parts = EngineTargets { composite: &views[0], indirect, irradiance };

    let mut encoder = rented.encoder();
    rented.record(&mut encoder, &camera, 7, &parts);
    rented.record(&mut encoder, &other, 8, &composite(&views[1]));
    rented.renderer().set_lights(vec![sun()], sky()).expect("lights");
    rented.record(&mut encoder, &camera, 9, &composite(&views[2]));
    assert!(!rented.submit(encoder), "the buffers had their size");

    let gpu = rented.renderer().gpu();
    for (i, frame) in [&first, &second, &third].into_iter().enumerate() {
        assert_same(&read(gpu, &views[i]), &frame.layers.beauty(), &format!("frame {i}"));
    }
    assert_same(&read(gpu, &views[3]), &first.layers.indirect, "indirect");
    // The engine reflects the irradiance itself.
    let irradiance = read(gpu, &views[4]).into_iter().zip(&first.layers.albedo);
    let reflected = irradiance.map(|([r, g, b, ratio], albedo)| {
        let light = Vec3::new(r, g, b) * ratio * *albedo * std::f32::consts::FRAC_1_PI;
        light.extend(ratio).to_array()
    });
    // Two of its factors have been rounded.
    let reflected: Vec<_> = reflected.collect();
    assert_close(&reflected, &first.layers.indirect, 2e-3, "reflected irradiance");
}

#[test]
fn other_lights_are_those_of_a_new_renderer() {
    let relight = |scene: &mut Scene| {
        only_a_lamp(scene);
        (scene.lights, scene.sky) = (vec![sun()], sky());
    };
    let Some(mut fresh) = Rented::new(relight) else { return };
    let expected = fresh.render(&settings(), 1).layers.beauty();
    drop(fresh);
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    // Buffers are those of the lights before.
    let before = rented.render(&settings(), 1).layers.beauty();
    rented.renderer().set_lights(vec![sun()], sky()).expect("lights");
    assert!(rented.render(&settings(), 1).layers.beauty() == expected);
    rented.renderer().set_lights(vec![lamp()], None).expect("lights");
    assert!(rented.render(&settings(), 1).layers.beauty() == before);
}

/// A lamp of which one in some hundred paths meets the box.
fn far_lamp(turn: u32) -> Light {
    let position = Vec3::new(0.1 * turn as f32, 1.0, 40.0);
    let (direction, intensity) = (Vec3::NEG_Z, Vec3::splat(4e4));
    Light::Spot { position, direction, intensity, cos_outer: 0.9, cos_inner: 0.95 }
}

#[test]
fn lights_that_change_every_frame_and_that_few_paths_find_are_complete_at_last() {
    let relight = |scene: &mut Scene| {
        only_a_lamp(scene);
        scene.lights = vec![far_lamp(0)];
    };
    let Some(mut rented) = Rented::new(relight) else { return };
    let (camera, view) = (rented.camera.clone(), rented.target());
    let lacked: Vec<_> = (0..10)
        .map(|turn| {
            let mut encoder = rented.encoder();
            rented.record(&mut encoder, &camera, turn, &composite(&view));
            // What the frame tells comes back when its light is gone.
            rented.renderer().set_lights(vec![far_lamp(turn + 1)], None).expect("lights");
            rented.submit(encoder)
        })
        .collect();
    let rounds = rented.renderer().buffers.as_ref().expect("buffers").rounds();
    assert!(rounds > 3, "{rounds} rounds: as many as any light has");
    assert!(lacked[0] && lacked[5..].iter().all(|lacked| !lacked), "{lacked:?}");
}

#[test]
fn darkness_is_refused_and_the_lights_stay() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let before = rented.render(&settings(), 1).layers.beauty();
    for lights in [Vec::new(), vec![Light::Point { position: Vec3::ZERO, intensity: Vec3::NAN }]] {
        let refused = rented.renderer().set_lights(lights, None).expect_err("dark");
        assert!(refused.to_string().contains("nothing in it shines"), "{refused}");
    }
    assert!(rented.render(&settings(), 1).layers.beauty() == before);
}

#[test]
fn a_frame_that_lacks_room_makes_room_for_the_next() {
    let Some(mut rented) = Rented::new(|_| ()) else { return };
    let expected = rented.render(&settings(), 4).layers.beauty();
    let GpuRenderer { gpu, buffers, .. } = rented.renderer();
    buffers.as_mut().expect("buffers").lose_room(gpu, &settings());
    let (view, camera) = (rented.target(), rented.camera.clone());
    let mut lacked = Vec::new();
    while lacked.len() < 8 && lacked.last() != Some(&false) {
        let mut encoder = rented.encoder();
        rented.record(&mut encoder, &camera, 4, &composite(&view));
        lacked.push(rented.submit(encoder));
    }
    assert!(lacked.len() > 1 && lacked.last() == Some(&false), "{lacked:?}");
    assert_same(&read(rented.renderer().gpu(), &view), &expected, "with room");
}

/// Settings of frames that add up, and frames of a still camera.
fn added_up(rented: &mut Rented, count: u32) -> (Settings, Vec<Vec<Vec3>>) {
    let mut settings = settings();
    settings.filter.temporal = true;
    let camera = rented.camera.clone();
    let renderer = rented.renderer();
    renderer.forget_past();
    let frame = |n| {
        let frame = renderer.render_next(&camera, SIZE, &settings, n, &|_, _| ());
        frame.expect("frame").layers.beauty()
    };
    let frames = (0..count).map(frame).collect();
    renderer.forget_past();
    (settings, frames)
}

#[test]
fn recorded_frames_add_up_as_rendered_ones_do() {
    let Some(mut rented) = Rented::new(|_| ()) else { return };
    let (settings, expected) = added_up(&mut rented, 4);
    let (camera, traced) = (rented.camera.clone(), EngineReceivers::Traced);
    let views: Vec<_> = (0..4).map(|_| rented.target()).collect();
    let record = |rented: &mut Rented, n: usize, encoder: &mut wgpu::CommandEncoder| {
        let (seed, target) = (n as u32, composite(&views[n]));
        let renderer = rented.renderer();
        renderer.record_into(encoder, &camera, &settings, seed, traced, &target).expect("frame");
    };
    // Two in one submission, and one alone.
    let mut encoder = rented.encoder();
    (0..2).for_each(|n| record(&mut rented, n, &mut encoder));
    assert!(!rented.submit(encoder));
    let mut encoder = rented.encoder();
    record(&mut rented, 2, &mut encoder);
    assert!(!rented.submit(encoder));
    for (n, expected) in expected.iter().take(3).enumerate() {
        assert_same(&read(rented.renderer().gpu(), &views[n]), expected, &format!("frame {n}"));
    }
    // One that is dropped ends the past.
    let mut encoder = rented.encoder();
    record(&mut rented, 1, &mut encoder);
    drop(encoder);
    rented.renderer().after_submit().expect("looked");
    let mut encoder = rented.encoder();
    record(&mut rented, 0, &mut encoder);
    rented.submit(encoder);
    assert_same(&read(rented.renderer().gpu(), &views[0]), &expected[0], "anew");
}

#[test]
fn a_frame_that_is_rendered_again_is_added_once() {
    let Some(mut rented) = Rented::new(|_| ()) else { return };
    let (settings, expected) = added_up(&mut rented, 3);
    let camera = rented.camera.clone();
    for (n, expected) in expected.iter().enumerate() {
        let GpuRenderer { gpu, buffers, .. } = rented.renderer();
        let buffers = buffers.as_mut().expect("buffers");
        buffers.lose_room(gpu, &settings);
        let before = buffers.origin();
        let frame = rented.renderer().render_next(&camera, SIZE, &settings, n as u32, &|_, _| ());
        assert!(frame.expect("frame").layers.beauty() == *expected, "frame {n}");
        let after = rented.renderer().buffers.as_ref().expect("buffers");
        assert!(!after.are_of(&before), "frame {n} was not rendered again");
    }
}

#[test]
fn frames_that_are_never_submitted_are_forgotten() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let (view, camera) = (rented.target(), rented.camera.clone());
    for _ in 0..3 {
        let mut encoder = rented.encoder();
        rented.record(&mut encoder, &camera, 4, &composite(&view));
    }
    assert!(!rented.renderer().after_submit().expect("looked"));
    assert!(rented.renderer().in_flight.frames.is_empty());
}

#[test]
fn what_cannot_be_is_a_sentence() {
    let Some(mut rented) = Rented::new(only_a_lamp) else { return };
    let (view, camera) = (rented.target(), rented.camera.clone());
    let gpu = rented.renderer().gpu();
    let small = texture(gpu, [16, 16], USAGE);
    let no_storage = texture(gpu, SIZE, TextureUsages::COPY_SRC | TextureUsages::TEXTURE_BINDING);
    let brute = Settings { method: Method::Brute, ..settings() };
    let mut huge = settings();
    huge.vpls.count = 16_000_000;
    let good = settings();
    let both = EngineTargets { indirect: Some(&small), ..composite(&view) };
    let traced = EngineReceivers::Traced;
    let drawn = EngineReceivers::Textures(ReceiverTextures {
        position_depth: &no_storage,
        normal: &no_storage,
        geometric_normal: None,
        albedo: &no_storage,
        emission: None,
    });
    let limit = "allows 134217728 in one";
    let cases = [
        (&brute, traced, composite(&view), "brute takes many submissions"),
        (&huge, traced, composite(&view), limit),
        (&good, traced, composite(&no_storage), "without the usage"),
        (&good, traced, both, "the texture of indirect light is 16 x 16"),
        (&good, drawn, composite(&view), "positions and depths holds Rgba16Float instead"),
    ];
    let mut encoder = rented.encoder();
    for (settings, receivers, targets, sentence) in cases {
        let renderer = rented.renderer();
        let result = renderer.record_into(&mut encoder, &camera, settings, 0, receivers, &targets);
        let problem = result.expect_err(sentence).to_string();
        assert!(problem.contains(sentence) && problem.lines().count() == 1, "{problem}");
    }
    // The same by the other door, and nothing is broken.
    let result = rented.renderer().render(&camera, SIZE, &huge, &|_, _| ());
    let problem = result.expect_err("too many lights").to_string();
    assert!(problem.contains(limit), "{problem}");
    rented.record(&mut encoder, &camera, 0, &composite(&view));
    rented.submit(encoder);
}

#[test]
fn a_lost_device_is_a_sentence() {
    if device().is_none() {
        return;
    }
    let options = GpuOptions { base: true, software: true, ..GpuOptions::default() };
    let gpu = Gpu::open(&options).expect("device");
    let shot = manylight_scene::builtin("cornell").expect("builtin");
    let renderer = Renderer::new(shot.scene).expect("scene");
    let mut renderer = GpuRenderer::new(gpu, renderer).expect("renderer");
    let view = texture(renderer.gpu(), SIZE, USAGE);
    let mut encoder = renderer.gpu().device().create_command_encoder(&Default::default());
    renderer.gpu().device().destroy();
    for _ in 0..2 {
        let rendered = renderer.render(&shot.camera, SIZE, &settings(), &|_, _| ());
        let problem = rendered.expect_err("lost").to_string();
        assert!(problem.contains("the device was lost"), "{problem}");
    }
    let (traced, settings) = (EngineReceivers::Traced, settings());
    let targets = composite(&view);
    let recorded = renderer.record_into(&mut encoder, &shot.camera, &settings, 0, traced, &targets);
    assert!(recorded.expect_err("lost").to_string().contains("the device was lost"));
}

#[test]
fn a_picture_of_8_megapixels_with_the_most_rays_is_recorded() {
    let Some(mut rented) = Rented::new(|_| ()) else { return };
    let camera = rented.camera.clone();
    let renderer = rented.renderer();
    let target = texture(renderer.gpu(), [3840, 2160], USAGE);
    let mut settings = settings();
    settings.shadow.rays = 256;
    let mut encoder = renderer.gpu().device().create_command_encoder(&Default::default());
    let (traced, targets) = (EngineReceivers::Traced, composite(&target));
    renderer.record_into(&mut encoder, &camera, &settings, 0, traced, &targets).expect("frame");
    let uniforms = renderer.gpu().lists().into_iter().find(|(name, _)| *name == "uniforms");
    assert!(uniforms.is_some_and(|(_, bytes)| bytes > 1 << 20), "{uniforms:?} would do before");
}

//! Light inside an engine, by the example's own engine, against the renderer's own picture.

#[path = "../examples/embed/engine.rs"]
mod engine;

use engine::Engine;
use manylight::frame::gpu::{EngineReceivers, EngineTargets, GpuRenderer};
use manylight::gpu::{Features, Gpu};
use manylight::{Renderer, Settings};

const SIZE: [u32; 2] = [96, 64];

/// The engine's composite and the renderer's picture, pixel by pixel.
fn pictures(scene: &str, drawn: bool) -> Option<Vec<[[f32; 3]; 2]>> {
    let Some((device, queue, name)) = engine::open() else {
        manylight_testing::skip_without_device("there is no graphics device");
        return None;
    };
    let mut shot = manylight_scene::load(scene).expect("shot");
    engine::remove_pictures(&mut shot.scene);
    let mut settings = Settings::default();
    settings.vpls.count = 1000;
    settings.vpls.emitter_count = 300;
    settings.grid.alpha = Some(0.8);
    settings.seed = 11;
    if drawn {
        // Half floats of normals change the weights that rays are drawn by, and with them which
        // lights are drawn: the noise would differ.
        settings.shadow.rays = 0;
    }
    let engine = Engine::new(device.clone(), queue.clone(), &shot.scene, SIZE, 1.0);
    let gpu = Gpu::from_device(device, queue, name, Features::ALL).expect("device");
    let renderer = Renderer::new(shot.scene).expect("scene");
    let mut light = GpuRenderer::new(gpu, renderer).expect("renderer");
    // Buffers find their size here.
    let size = SIZE.map(|n| n as usize);
    let frame = light.render(&shot.camera, size, &settings, &|_, _| ()).expect("frame");

    let mut encoder = engine.device.create_command_encoder(&Default::default());
    engine.draw(&mut encoder, &shot.camera);
    let receivers = match drawn {
        true => EngineReceivers::Textures(engine.receivers()),
        false => EngineReceivers::Traced,
    };
    let targets = EngineTargets { composite: &engine.composite, indirect: None, irradiance: None };
    light
        .record_into(&mut encoder, &shot.camera, &settings, settings.seed, receivers, &targets)
        .expect("frame");
    engine.show(&mut encoder);
    engine.queue.submit([encoder.finish()]);
    let composite = engine.read(&engine.composite, 8);
    assert!(!light.after_submit().expect("looked"), "the buffers had their size");
    let screen = engine.read(&engine.screen, 4);
    assert!(screen.chunks(4).any(|texel| texel[..3].iter().any(|&c| c > 100)), "dark screen");
    let half = |b: &[u8]| f32_of_half(u16::from_le_bytes([b[0], b[1]]));
    let found = composite.chunks(8).map(|t| [half(t), half(&t[2..]), half(&t[4..])]);
    Some(found.zip(frame.layers.beauty()).map(|(f, e)| [f, e.to_array()]).collect())
}

fn f32_of_half(bits: u16) -> f32 {
    let (exponent, mantissa) = (bits >> 10 & 31, f32::from(bits & 1023) / 1024.0);
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    sign * match exponent {
        0 => mantissa * 2f32.powi(-14),
        31 => f32::INFINITY,
        _ => (1.0 + mantissa) * 2f32.powi(i32::from(exponent) - 15),
    }
}

/// Largest difference of a channel, and the largest channel of what is expected.
fn difference([found, expected]: &[[f32; 3]; 2]) -> (f32, f32) {
    let difference = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    (difference, expected.iter().copied().fold(0.0, f32::max))
}

#[test]
fn traced_receivers_give_the_same_picture() {
    let Some(pixels) = pictures("builtin:cornell", false) else { return };
    for (i, pixel) in pixels.iter().enumerate() {
        // Half floats have eleven bits, and may be rounded towards zero.
        let (difference, scale) = difference(pixel);
        assert!(difference <= scale * 1e-3 + 1e-6, "pixel {i}: {pixel:?}");
    }
}

#[test]
fn drawn_receivers_give_the_same_picture_but_for_silhouettes() {
    for scene in ["builtin:cornell", "builtin:atrium"] {
        let Some(pixels) = pictures(scene, true) else { return };
        let differ = |p: &&[[f32; 3]; 2]| {
            let (difference, scale) = difference(p);
            difference > 0.02 * scale + 1e-4
        };
        let others = pixels.iter().filter(differ).count();
        let mean = |k: usize| {
            let sum = |p: &[[f32; 3]; 2]| p[k].iter().map(|&c| f64::from(c)).sum::<f64>();
            pixels.iter().filter(|p| !differ(p)).map(sum).sum::<f64>()
        };
        let bias = mean(0) / mean(1) - 1.0;
        println!("{scene}: {others} of {} pixels differ, mean by {bias:.5}", pixels.len());
        assert!(others * 50 <= pixels.len(), "{scene}: {others} of {} pixels", pixels.len());
        assert!(bias.abs() < 2e-3, "{scene}: mean off by {bias}");
    }
}

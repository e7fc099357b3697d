//! The Vulkan validation layer has nothing to say about frames. A process of its own: it takes what
//! the graphics library logs.
#![cfg(feature = "gpu")]

#[path = "../examples/embed/engine.rs"]
mod engine;

use manylight::frame::gpu::{EngineReceivers, EngineTargets, GpuRenderer};
use manylight::gpu::{Features, Gpu, GpuOptions};
use manylight::{Method, Renderer, Settings};
use manylight_testing::{is_device_required, skip, skip_without_device, skip_without_feature};
use std::sync::{Mutex, Once, PoisonError};

/// The layer's name, which the loader says when it takes the layer in.
const LAYER: &str = "VK_LAYER_KHRONOS_validation";
/// Layers of 1.3 do not know the number by which shaders say that they were written in WGSL.
const FALSE_ALARM: &str = "Invalid source language operand";
const SIZE: [usize; 2] = [24, 16];

/// What the graphics library says.
static MESSAGES: Mutex<Vec<(log::Level, String)>> = Mutex::new(Vec::new());

struct Collector;

impl log::Log for Collector {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.target().starts_with("wgpu_hal")
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            let mut messages = MESSAGES.lock().unwrap_or_else(PoisonError::into_inner);
            let text = record.args().to_string();
            match messages.last_mut().filter(|_| text.starts_with('\t')) {
                // What objects the last message is about.
                Some((_, last)) => *last += &text,
                None => messages.push((record.level(), text)),
            }
        }
    }

    fn flush(&self) {}
}

/// What was said since the last time.
fn messages() -> Vec<(log::Level, String)> {
    std::mem::take(&mut MESSAGES.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Does something on a device that it opens; checks that the layer was there and found nothing.
fn check(work: impl FnOnce() -> Option<()>) {
    static START: Once = Once::new();
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let flags = wgpu::InstanceFlags::from_build_config().with_env();
    if !flags.contains(wgpu::InstanceFlags::VALIDATION) {
        return skip("calls are checked in debug builds, and where WGPU_VALIDATION=1");
    }
    START.call_once(|| {
        log::set_logger(&Collector).expect("the only logger");
        log::set_max_level(log::LevelFilter::Debug);
    });
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    messages();
    if work().is_none() {
        return;
    }
    let (bad, other): (Vec<_>, Vec<_>) =
        messages().into_iter().partition(|(level, _)| *level <= log::Level::Warn);
    // The graphics library names it too, where it finds none.
    let is_loader = |text: &str| text.starts_with("GENERAL") && text.contains(LAYER);
    if !other.iter().any(|(_, text)| is_loader(text)) {
        let reason = "the Vulkan validation layer is not there; see cargo xtask setup";
        assert!(!is_device_required(), "{reason}");
        return skip(reason);
    }
    let bad: Vec<_> = bad.iter().filter(|(_, text)| !text.contains(FALSE_ALARM)).collect();
    assert!(bad.is_empty(), "{bad:#?}");
}

fn settings(preset: &str, method: Method) -> Settings {
    let mut settings = Settings { method, ..Settings::preset(preset).expect(preset) };
    (settings.vpls.count, settings.vpls.emitter_count) = (500, 100);
    (settings.path.spp, settings.film.samples) = (2, 2);
    settings
}

/// Frames of every method and corridor on a device; none where there is no device.
fn render(options: &GpuOptions) -> Option<()> {
    let options = GpuOptions { software: true, ..options.clone() };
    let opened = Gpu::open(&options);
    let gpu = opened.inspect_err(|reason| skip_without_device(&reason.to_string())).ok()?;
    if !options.base && gpu.features() != options.features {
        let offered = gpu.features().names().join(" ");
        let rest = format!("{}, which offers no more than {offered}", gpu.name());
        skip_without_feature(&format!("all but what is left on {rest}"));
    }
    let shot = manylight_scene::load("builtin:atrium").expect("a shot");
    let renderer = Renderer::new(shot.scene).expect("a scene");
    let mut light = GpuRenderer::new(gpu, renderer).map_err(|(_, e)| e).expect("on the device");
    let mut interleaved = settings("balanced", Method::Grid);
    interleaved.interleave = 2;
    for settings in [
        settings("balanced", Method::Grid),
        settings("paper", Method::Grid),
        interleaved,
        settings("balanced", Method::Brute),
        settings("balanced", Method::Path),
        settings("balanced", Method::Direct),
    ] {
        let frame = light.render(&shot.camera, SIZE, &settings, &|_, _| ());
        frame.expect("a frame");
    }
    let mut temporal = settings("balanced", Method::Grid);
    (temporal.filter.temporal, temporal.film.samples) = (true, 1);
    for frame in 0..2 {
        light.render_next(&shot.camera, SIZE, &temporal, frame, &|_, _| ()).expect("a frame");
    }
    light.time_frame(&shot.camera, SIZE, &temporal, true).expect("a frame");
    Some(())
}

/// Frames among the commands of an engine, with its receivers and with ours.
fn record() -> Option<()> {
    let Some((device, queue, name)) = engine::open() else {
        skip_without_device("there is no graphics device");
        return None;
    };
    let mut shot = manylight_scene::load("builtin:atrium").expect("a shot");
    engine::remove_pictures(&mut shot.scene);
    let size = SIZE.map(|n| n as u32);
    let engine = engine::Engine::new(device.clone(), queue.clone(), &shot.scene, size, 1.0);
    let gpu = Gpu::from_device(device, queue, name, Features::ALL).expect("a device");
    let renderer = Renderer::new(shot.scene).expect("a scene");
    let mut light = GpuRenderer::new(gpu, renderer).map_err(|(_, e)| e).expect("on the device");
    let settings = settings("balanced", Method::Grid);
    for (seed, drawn) in [false, true, true].into_iter().enumerate() {
        let mut encoder = engine.device.create_command_encoder(&Default::default());
        engine.draw(&mut encoder, &shot.camera);
        let receivers = match drawn {
            true => EngineReceivers::Textures(engine.receivers()),
            false => EngineReceivers::Traced,
        };
        let targets =
            EngineTargets { composite: &engine.composite, indirect: None, irradiance: None };
        light
            .record_into(&mut encoder, &shot.camera, &settings, seed as u32, receivers, &targets)
            .expect("a frame");
        engine.show(&mut encoder);
        engine.queue.submit([encoder.finish()]);
        light.after_submit().expect("looked");
    }
    engine.read(&engine.screen, 4);
    Some(())
}

#[test]
fn the_layer_finds_nothing() {
    check(|| render(&GpuOptions { base: true, ..GpuOptions::default() }));
}

#[test]
fn the_layer_finds_nothing_with_ray_queries_and_all_else_that_is_offered() {
    check(|| render(&GpuOptions { features: Features::ALL, ..GpuOptions::default() }));
}

#[test]
fn the_layer_finds_nothing_in_an_engine() {
    check(record);
}

//! The Vulkan validation layer has nothing to say about a frame. A process of its own: it takes
//! what the graphics library logs.
#![cfg(feature = "gpu")]

use manylight::frame::gpu::GpuRenderer;
use manylight::gpu::{Features, Gpu};
use manylight::{Method, Renderer, Settings};
use std::sync::{Mutex, PoisonError};

/// The library's words where the layer is not installed.
const NO_LAYER: &str = "unable to find layer";
/// Layers of 1.3 do not know the number by which shaders say that they were written in WGSL.
const FALSE_ALARM: &str = "Invalid source language operand";

/// Warnings and errors of the graphics library.
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

struct Collector;

impl log::Log for Collector {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn && metadata.target().starts_with("wgpu_hal")
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) {
            let mut messages = MESSAGES.lock().unwrap_or_else(PoisonError::into_inner);
            messages.push(format!("{} {}", record.level(), record.args()));
        }
    }

    fn flush(&self) {}
}

fn messages() -> Vec<String> {
    std::mem::take(&mut MESSAGES.lock().unwrap_or_else(PoisonError::into_inner))
}

/// A Vulkan device whose calls are checked, with no more than every device has; says why not where
/// there is none.
fn open() -> Option<Gpu> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN;
    descriptor.flags = wgpu::InstanceFlags::VALIDATION;
    let instance = wgpu::Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let limits = wgpu::Limits::defaults();
    let adapter = adapters.into_iter().find(|a| limits.check_limits(&a.limits()));
    let is_required = std::env::var_os("MANYLIGHT_REQUIRE_GPU").is_some_and(|v| v == "1");
    let Some(adapter) = adapter else {
        assert!(!is_required, "a graphics device is required, and there is none with Vulkan");
        eprintln!("skipped: no graphics device with Vulkan");
        return None;
    };
    if messages().iter().any(|message| message.contains(NO_LAYER)) {
        eprintln!("skipped: the Vulkan validation layer is not installed; see cargo xtask setup");
        return None;
    }
    let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
    let opened = pollster::block_on(adapter.request_device(&descriptor));
    let (device, queue) = opened.expect("a device");
    Some(
        Gpu::from_device(device, queue, adapter.get_info().name, Features::ALL)
            .expect("a device that will do"),
    )
}

#[test]
fn the_validation_layer_finds_nothing() {
    log::set_logger(&Collector).expect("the only logger");
    log::set_max_level(log::LevelFilter::Warn);
    let Some(gpu) = open() else { return };
    let shot = manylight_scene::load("builtin:atrium").expect("a shot");
    let renderer = Renderer::new(shot.scene).expect("a scene");
    let mut engine = GpuRenderer::new(gpu, renderer).map_err(|(_, e)| e).expect("on the device");
    for (preset, method) in [
        ("balanced", Method::Grid),
        ("paper", Method::Grid),
        ("balanced", Method::Brute),
        ("balanced", Method::Path),
        ("balanced", Method::Direct),
    ] {
        let mut settings = Settings { method, ..Settings::preset(preset).expect(preset) };
        (settings.vpls.count, settings.vpls.emitter_count) = (500, 100);
        (settings.path.spp, settings.film.samples) = (2, 2);
        let frame = engine.render(&shot.camera, [24, 16], &settings, &|_, _| ());
        frame.expect("a frame");
    }
    drop(engine);
    let found = messages();
    let bad: Vec<_> = found.iter().filter(|m| !m.contains(FALSE_ALARM)).collect();
    assert!(bad.is_empty(), "{bad:#?}");
}

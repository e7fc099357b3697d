//! Global illumination inside an engine that has a device, commands and textures of its own.
//! `cargo run --release --example embed -- embed.png`

mod engine;

use engine::Engine;
use manylight::frame::gpu::{EngineReceivers, EngineTargets, GpuRenderer};
use manylight::gpu::{Features, Gpu};
use manylight::{Renderer, Settings};
use manylight_image::write_png_rgb8;
use std::error::Error;

const SIZE: [u32; 2] = [640, 360];
/// Frames after which the picture is taken in any case.
const MOST_FRAMES: u32 = 8;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "embed.png".to_owned());
    let mut shot = manylight_scene::load("builtin:atrium")?;
    engine::remove_pictures(&mut shot.scene);
    let settings = Settings::preset("draft")?;

    // The engine's own: a device, geometry, textures.
    let (device, queue, name) = engine::open().ok_or("no graphics device found")?;
    println!("{name}");
    let engine = Engine::new(device.clone(), queue.clone(), &shot.scene, SIZE, 0.5);

    // The light: the same device, the same triangles.
    let gpu = Gpu::from_device(device, queue, name, Features::ALL)?;
    let mut light = GpuRenderer::new(gpu, Renderer::new(shot.scene)?).map_err(|(_, e)| e)?;

    for frame in 0..MOST_FRAMES {
        let mut encoder = engine.device.create_command_encoder(&Default::default());
        engine.draw(&mut encoder, &shot.camera);
        let receivers = EngineReceivers::Textures(engine.receivers());
        let composite = &engine.composite;
        let targets = EngineTargets { composite, indirect: None, irradiance: None };
        light.record_into(&mut encoder, &shot.camera, &settings, frame, receivers, &targets)?;
        engine.show(&mut encoder);
        engine.queue.submit([encoder.finish()]);
        // A window would present here and go on. Who wants one whole picture waits and looks.
        engine.device.poll(wgpu::PollType::wait_indefinitely())?;
        let lacked = light.after_submit()?;
        println!("frame {frame}{}", if lacked { ": buffers grow" } else { "" });
        if !lacked {
            break;
        }
    }

    let texels = engine.read(&engine.screen, 4);
    let rgb: Vec<u8> = texels.chunks(4).flat_map(|texel| &texel[..3]).copied().collect();
    write_png_rgb8(&rgb, SIZE[0] as usize, SIZE[1] as usize, path.as_ref())?;
    println!("{path}");
    Ok(())
}

//! The least program: a builtin scene, one picture. `cargo run --release --example hello`

use manylight::{Renderer, Settings};
use manylight_image::{Raster, ToneSettings, write_png};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let shot = manylight_scene::load("builtin:cornell")?;
    let renderer = Renderer::new(shot.scene)?;
    let settings = Settings::preset("balanced")?;
    let size = [360, 360];
    let frame = renderer.render(&shot.camera, size, &settings, &|_, _| ())?;
    let data = frame.layers.beauty().iter().flat_map(|c| c.to_array()).collect();
    let picture = Raster { width: size[0], height: size[1], channels: 3, data };
    write_png(&picture, &ToneSettings::default(), "hello.png".as_ref())?;
    println!("hello.png");
    Ok(())
}

//! Global illumination by turning light transport into direct light from very many lights.
//!
//! Rooms stand in the order in which light and data travel; a room uses only rooms above it.
//!
//! ```
//! use manylight::{Renderer, Settings};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let shot = manylight_scene::load("builtin:cornell")?;
//! let renderer = Renderer::new(shot.scene)?;
//! let mut settings = Settings::preset("draft")?;
//! settings.vpls.count = 2000;
//! let frame = renderer.render(&shot.camera, [64, 64], &settings, &|_, _| ())?;
//! assert!(frame.layers.beauty().iter().any(|c| c.max_element() > 0.0));
//! # Ok(())
//! # }
//! ```

// Basement: used by all, knows no light transport.
pub mod error;
pub mod settings;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod math;
// The ground: what is where.
pub mod bvh;
pub mod world;
pub mod surface;
// Light enters.
pub mod emitter;
pub mod vlight;
pub mod shadow;
// Many lights become one radiance.
pub mod direct;
pub mod gather;
// The picture.
pub mod filter;
pub mod composite;
pub mod reference;
pub mod frame;
pub mod bench;

pub use error::Error;
pub use frame::{Frame, Renderer};
pub use settings::{Method, Settings};

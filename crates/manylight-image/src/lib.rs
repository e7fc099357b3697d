//! Float images.
mod raster;
pub use raster::{LayeredImage, Raster};

//! Scenes for the manylight renderer: glTF files, shot files and procedural scenes become one
//! [`Scene`].

mod scene;
pub mod procedural;
mod error;

pub use error::{Error, Warning};
pub use scene::{
    AlphaMode, Camera, Instance, Light, Material, Mesh, Projection, Scene, Sky, SkyMap,
    TextureImage, TextureSlot, Wrap,
};

/// A scene seen by a camera, with the settings its author chose.
#[derive(Clone, Debug)]
pub struct Shot {
    /// What is where.
    pub scene: Scene,
    /// The view.
    pub camera: Camera,
    /// The `settings` object of a shot file, untouched; empty for a bare scene. The renderer
    /// that owns the settings checks them.
    pub settings: serde_json::Map<String, serde_json::Value>,
    /// Oddities that were repaired or left out.
    pub warnings: Vec<Warning>,
}

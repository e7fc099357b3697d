//! Scenes for the manylight renderer: glTF files, shot files and procedural scenes become one
//! [`Scene`].
//!
//! [`load`] takes any of them; [`load_gltf_bytes`] and [`parse_shot_text`] work on bytes alone.
//! No input, however damaged, panics or allocates without bound: it is repaired with a counted
//! [`Warning`] or refused with an [`Error`] of one sentence.

mod scene;
mod camera_path;
mod error;
mod json;
mod gltf;
mod shot;
mod sky;
mod validate;
mod procedural;
mod load;

pub use camera_path::{CameraKey, CameraPath};
pub use error::{Error, Warning};
pub use load::{load, load_gltf_bytes};
pub use procedural::{BUILTINS, builtin};
pub use scene::{
    AlphaMode, Camera, Instance, Light, Material, Mesh, Projection, Scene, Sky, SkyMap,
    TextureImage, TextureSlot, Wrap,
};
pub use shot::{MAX_PIXELS, ShotFile, ShotLight, parse_shot_text};

/// A scene seen by a camera, with the settings its author chose.
#[derive(Clone, Debug)]
pub struct Shot {
    /// What is where.
    pub scene: Scene,
    /// The view; that of frame 0.
    pub camera: Camera,
    /// Where the camera is in the frames of a sequence.
    pub path: CameraPath,
    /// The `settings` object of a shot file, untouched; empty for a bare scene. The renderer
    /// that owns the settings checks them.
    pub settings: serde_json::Map<String, serde_json::Value>,
    /// Oddities that were repaired or left out.
    pub warnings: Vec<Warning>,
    /// The file it was loaded from, and all that this one names; none where it is built in.
    pub files: Vec<std::path::PathBuf>,
}

impl Shot {
    /// Looks through the scene's camera of this name or number, which stands still; the size of
    /// the picture stays. `place` is where the name was written, for messages.
    ///
    /// Errors: one sentence with the cameras there are.
    pub fn use_camera(&mut self, name: &str, place: &str) -> Result<(), Error> {
        let mut camera = load::find_camera(&self.scene, name, place)?.clone();
        camera.size_px = camera.size_px.or(self.camera.size_px);
        self.camera = camera;
        self.path = CameraPath::default();
        Ok(())
    }
}

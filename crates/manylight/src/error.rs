//! What can go wrong in a render, in sentences for its user.

/// Why a render could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting is unknown or outside its range.
    #[error("setting {path}: {problem}")]
    Setting {
        /// Path of the field, e.g. `grid.alpha`.
        path: String,
        /// What is wrong and what is allowed.
        problem: String,
    },
    /// The scene cannot be rendered.
    #[error("{scene}: {problem}")]
    Scene {
        /// Name of the scene.
        scene: String,
        /// What is wrong and what to do.
        problem: String,
    },
    /// The graphics device cannot do it.
    #[error("graphics device: {problem}")]
    Device {
        /// What is wrong and what to do.
        problem: String,
    },
}

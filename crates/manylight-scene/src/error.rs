//! What can be wrong with a scene file, in sentences for its author.

/// Why a scene could not be used. The text names the thing, the value, what was allowed and
/// what to do next.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read.
    #[error("cannot read {path}: {reason}")]
    Read {
        /// The file.
        path: String,
        /// The system's or decoder's words.
        reason: String,
    },
    /// A file was read but its content cannot be used.
    #[error("{place}: {problem}")]
    Invalid {
        /// File and position inside it, e.g. `shot.json: camera.vfov_deg`.
        place: String,
        /// What is wrong, what was allowed, what to do.
        problem: String,
    },
}

/// Something in a scene that was repaired or left out, with how often it occurred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// One sentence without the count.
    pub message: String,
    /// How often.
    pub count: u64,
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}×)", self.message, self.count)
    }
}

//! Group 1 of kernels that trace rays, and what they can leave out.

use super::{KernelInfo, Value};

/// What is in a scene. Kernels that trace rays are built for what theirs has: code that is not
/// there takes no registers, and so leaves room for more rays at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SceneTraits {
    /// Instances of shared meshes.
    pub placements: bool,
    /// Surfaces that some rays pass: cut-out texels, blended ones.
    pub holes: bool,
}

impl SceneTraits {
    /// Everything there may be.
    pub const ALL: Self = Self { placements: true, holes: true };

    /// Every combination, the one with everything first.
    #[cfg(test)]
    pub const COMBINATIONS: [Self; 4] = [
        Self::ALL,
        Self { placements: true, holes: false },
        Self { placements: false, holes: true },
        Self { placements: false, holes: false },
    ];

    /// As far as it matters to a kernel: all, where that looks at no scene.
    pub(super) fn of_kernel(self, kernel: &KernelInfo) -> Self {
        if kernel.scene { self } else { Self::ALL }
    }

    /// The constants by which shaders know it.
    pub(super) fn constants(self) -> [(&'static str, Value); 2] {
        [("HAS_PLACEMENTS", Value::Bool(self.placements)), ("HAS_HOLES", Value::Bool(self.holes))]
    }
}

/// A scene as kernels see it.
#[derive(Clone, Debug)]
pub struct SceneGroup {
    /// What they bind.
    pub group: wgpu::BindGroup,
    /// What they are built for.
    pub traits: SceneTraits,
}

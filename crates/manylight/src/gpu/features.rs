//! What a device may offer beyond what every device has, and which shaders make use of it.

use crate::settings::GpuSettings;

/// Something that not every device offers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Operations across the invocations that run in step.
    Subgroups,
    /// Numbers of 16 bits.
    Half,
    /// Rays that the hardware follows.
    RayQueries,
    /// Any number of textures in one binding.
    Bindless,
}

impl Feature {
    /// All there are.
    pub const ALL: [Self; 4] = [Self::Subgroups, Self::Half, Self::RayQueries, Self::Bindless];

    /// What the device is asked for.
    pub fn wgpu(self) -> wgpu::Features {
        match self {
            Self::Subgroups => wgpu::Features::SUBGROUP,
            Self::Half => wgpu::Features::SHADER_F16,
            Self::RayQueries => wgpu::Features::EXPERIMENTAL_RAY_QUERY,
            Self::Bindless => {
                wgpu::Features::TEXTURE_BINDING_ARRAY
                    | wgpu::Features::SAMPLED_TEXTURE_AND_STORAGE_BUFFER_ARRAY_NON_UNIFORM_INDEXING
                    | wgpu::Features::PARTIALLY_BOUND_BINDING_ARRAY
            }
        }
    }
}

/// A choice of features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Features {
    chosen: [bool; Feature::ALL.len()],
}

impl Features {
    /// Nothing but what every device has.
    pub const NONE: Self = Self { chosen: [false; Feature::ALL.len()] };
    /// Everything there is.
    pub const ALL: Self = Self { chosen: [true; Feature::ALL.len()] };

    /// One alone.
    pub fn only(feature: Feature) -> Self {
        let mut features = Self::NONE;
        features.chosen[feature as usize] = true;
        features
    }

    /// All but one.
    pub fn without(mut self, feature: Feature) -> Self {
        self.chosen[feature as usize] = false;
        self
    }

    /// Whether one is among them.
    pub fn has(self, feature: Feature) -> bool {
        self.chosen[feature as usize]
    }

    /// Those among them that a device offers.
    pub fn offered_by(self, offered: wgpu::Features) -> Self {
        let has = |f: Feature| self.has(f) && offered.contains(f.wgpu());
        Self { chosen: Feature::ALL.map(has) }
    }

    /// What the device is asked for.
    pub fn wgpu(self) -> wgpu::Features {
        let chosen = Feature::ALL.into_iter().filter(|&f| self.has(f));
        chosen.fold(wgpu::Features::empty(), |all, f| all | f.wgpu())
    }

    /// The file that stands for a shader file: another one where a feature serves it better.
    pub(super) fn file<'a>(self, path: &'a str, variants: &'a [Variant]) -> &'a str {
        let mut stands = variants.iter().filter(|v| v.of == path && self.has(v.feature));
        stands.next().map_or(path, |v| v.by)
    }
}

impl From<&GpuSettings> for Features {
    fn from(settings: &GpuSettings) -> Self {
        let GpuSettings { base, subgroups, half, ray_queries, bindless, .. } = settings;
        let wanted = |feature| match feature {
            Feature::Subgroups => *subgroups,
            Feature::Half => *half,
            Feature::RayQueries => *ray_queries,
            Feature::Bindless => *bindless,
        };
        Self { chosen: Feature::ALL.map(|f| wanted(f) && !base) }
    }
}

/// A shader file that takes the place of another on devices that offer a feature. Both have the
/// same functions and, where they are kernels, the same bindings.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// What the device must offer.
    pub feature: Feature,
    /// Path of the file that every device can run.
    pub of: &'static str,
    /// Path of the file that stands for it.
    pub by: &'static str,
}

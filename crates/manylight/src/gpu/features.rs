//! What a device may offer beyond what every device has, and which shaders make use of it.

use crate::settings::GpuSettings;

/// What a device must bind one by one, or else pages of an array are used: as many as layers.
const LEAST_TEXTURES: u32 = 256;
/// Lists of a kernel where textures are bound one by one: the scene's uniform becomes one.
pub(super) const LISTS_BESIDE_TEXTURES: u32 = 9;

/// Something that not every device offers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Operations across the invocations that run in step.
    Subgroups,
    /// Numbers of 16 bits.
    Half,
    /// Times of stages by the device's own clock.
    Timestamps,
    /// Lists, buffers and textures beyond `wgpu::Limits::defaults()`.
    LargeLimits,
    /// Rays that the hardware follows.
    RayQueries,
    /// Any number of textures in one binding.
    Bindless,
}

impl Feature {
    /// All there are.
    pub const ALL: [Self; 6] = [
        Self::Subgroups,
        Self::Half,
        Self::Timestamps,
        Self::LargeLimits,
        Self::RayQueries,
        Self::Bindless,
    ];

    /// The last word of its setting.
    pub fn name(self) -> &'static str {
        match self {
            Self::Subgroups => "subgroups",
            Self::Half => "half",
            Self::Timestamps => "timestamps",
            Self::LargeLimits => "large_limits",
            Self::RayQueries => "ray_queries",
            Self::Bindless => "bindless",
        }
    }

    /// What the device is asked for.
    pub fn wgpu(self) -> wgpu::Features {
        match self {
            Self::Subgroups => wgpu::Features::SUBGROUP,
            Self::Half => wgpu::Features::SHADER_F16,
            Self::Timestamps => wgpu::Features::TIMESTAMP_QUERY,
            Self::LargeLimits => wgpu::Features::empty(),
            Self::RayQueries => wgpu::Features::EXPERIMENTAL_RAY_QUERY,
            Self::Bindless => {
                wgpu::Features::TEXTURE_BINDING_ARRAY
                    | wgpu::Features::SAMPLED_TEXTURE_AND_STORAGE_BUFFER_ARRAY_NON_UNIFORM_INDEXING
                    | wgpu::Features::PARTIALLY_BOUND_BINDING_ARRAY
            }
        }
    }

    /// Whether limits leave room for it: an engine's device may have it and no use for it.
    fn has_room(self, limits: &wgpu::Limits) -> bool {
        match self {
            // Opaque triangles and others in each hierarchy, below one.
            Self::RayQueries => {
                limits.max_blas_geometry_count >= 2
                    && limits.max_blas_primitive_count > 0
                    && limits.max_tlas_instance_count > 0
                    && limits.max_acceleration_structures_per_shader_stage > 0
            }
            Self::Bindless => {
                limits.max_binding_array_elements_per_shader_stage >= LEAST_TEXTURES
                    && limits.max_storage_buffers_per_shader_stage >= LISTS_BESIDE_TEXTURES
            }
            Self::LargeLimits => smallest(limits.clone()) != *limits,
            Self::Subgroups | Self::Half | Self::Timestamps => true,
        }
    }
}

/// Some limits with the room for lists, buffers and textures that every device has.
pub(super) fn smallest(limits: wgpu::Limits) -> wgpu::Limits {
    let wgpu::Limits {
        max_storage_buffer_binding_size,
        max_buffer_size,
        max_texture_dimension_2d,
        ..
    } = wgpu::Limits::defaults();
    wgpu::Limits {
        max_storage_buffer_binding_size,
        max_buffer_size,
        max_texture_dimension_2d,
        ..limits
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

    /// Names of those among them.
    pub fn names(self) -> Vec<&'static str> {
        Feature::ALL.into_iter().filter(|&f| self.has(f)).map(Feature::name).collect()
    }

    /// Those among them that a device offers, with limits that leave room for them.
    pub fn offered_by(self, offered: wgpu::Features, limits: &wgpu::Limits) -> Self {
        let has = |f: Feature| self.has(f) && offered.contains(f.wgpu()) && f.has_room(limits);
        Self { chosen: Feature::ALL.map(has) }
    }

    /// The same, then less and less, for drivers that offer what they do not have: what is rare and
    /// new goes first.
    pub(super) fn fewer(self) -> Vec<Self> {
        let common = self.without(Feature::RayQueries).without(Feature::Bindless);
        let plain = common.without(Feature::Subgroups).without(Feature::Half);
        let mut tried = vec![self, common, plain, Self::NONE];
        tried.dedup();
        tried
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
        let GpuSettings {
            base,
            subgroups,
            half,
            timestamps,
            large_limits,
            ray_queries,
            bindless,
            ..
        } = settings;
        let wanted = |feature| match feature {
            Feature::Subgroups => *subgroups,
            Feature::Half => *half,
            Feature::Timestamps => *timestamps,
            Feature::LargeLimits => *large_limits,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_open_is_given_up_from_the_rarest_on() {
        let names = |features: Features| -> Vec<_> {
            features.fewer().into_iter().map(|tried| tried.names().join(" ")).collect()
        };
        assert_eq!(
            names(Features::ALL),
            [
                "subgroups half timestamps large_limits ray_queries bindless",
                "subgroups half timestamps large_limits",
                "timestamps large_limits",
                ""
            ]
        );
        assert_eq!(names(Features::only(Feature::Half)), ["half", ""]);
        assert_eq!(names(Features::NONE), [""]);
    }
}

//! The graphics devices of this machine, and what is asked of one.

use super::features::LISTS_BESIDE_TEXTURES;
use super::loops::lists_with_last_loop;
use super::{Feature, Features};
use crate::error::Error;
use crate::settings::GpuSettings;
use std::path::PathBuf;
use std::time::Duration;

/// Most textures that are bound one by one.
pub(super) const MOST_TEXTURES: u32 = 1024;

/// How to open a device.
#[derive(Clone, Debug)]
pub struct GpuOptions {
    /// Part of the adapter's name, in any case, or `#2`: the second of [`describe_adapters`];
    /// `None`: the fastest.
    pub adapter: Option<String>,
    /// Takes only what every device has: `wgpu::Limits::defaults()` and no features. Devices that
    /// are emulated are asked for one more list of a kernel, by which loops are watched.
    pub base: bool,
    /// Whether a device that is emulated on the processor will do.
    pub software: bool,
    /// What is used where the device offers it; nothing with `base`. Without
    /// [`Feature::LargeLimits`] lists have at most 128 MiB.
    pub features: Features,
    /// A folder whose shaders stand for those of the program and may change meanwhile; only in
    /// builds with debug assertions.
    pub shaders: Option<PathBuf>,
    /// After which work that is not done counts as lost, see [`Gpu::wait`](super::Gpu::wait);
    /// `None`: ten minutes, and without end on a device that is emulated on the processor.
    pub timeout: Option<Duration>,
}

impl Default for GpuOptions {
    /// As the default settings.
    fn default() -> Self {
        Self::from(&GpuSettings::default())
    }
}

impl From<&GpuSettings> for GpuOptions {
    /// A device that is emulated will do where it is named. A time out of range is none.
    fn from(settings: &GpuSettings) -> Self {
        let GpuSettings { device, base, shaders, timeout, .. } = settings;
        let timeout = timeout.and_then(|seconds| Duration::try_from_secs_f32(seconds).ok());
        let shaders = shaders.as_ref().map(PathBuf::from);
        let (software, features) = (device.is_some(), Features::from(settings));
        Self { adapter: device.clone(), base: *base, software, features, shaders, timeout }
    }
}

/// A device of this machine.
#[derive(Clone, Debug)]
pub struct AdapterDescription {
    /// Name as the driver gives it.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: &'static str,
    /// Graphics interface: `vulkan`, `metal`, `dx12`.
    pub backend: String,
    /// Driver and its version.
    pub driver: String,
    /// Largest list that one kernel can see, bytes.
    pub max_binding: u64,
    /// Largest buffer, bytes.
    pub max_buffer: u64,
    /// Memory of a workgroup, bytes.
    pub workgroup_memory: u32,
    /// What it offers beyond what every device has.
    pub features: Features,
    /// What it lacks to render; `None` if nothing.
    pub lacks: Option<String>,
}

/// Every device of this machine, whether it will do or not.
pub fn describe_adapters() -> Vec<AdapterDescription> {
    adapters().iter().map(describe).collect()
}

fn adapters() -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    // A kernel's own arguments for indirect dispatches are trusted: they are clamped where written.
    descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    let instance = wgpu::Instance::new(descriptor);
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY))
}

fn describe(adapter: &wgpu::Adapter) -> AdapterDescription {
    let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    };
    let lacks = lacks(&limits);
    AdapterDescription {
        name: info.name,
        kind,
        backend: info.backend.to_string(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        max_binding: limits.max_storage_buffer_binding_size,
        max_buffer: limits.max_buffer_size,
        workgroup_memory: limits.max_compute_workgroup_storage_size,
        features: Features::ALL.offered_by(features, &limits),
        lacks: (!lacks.is_empty()).then(|| lacks.join(", ")),
    }
}

/// What some limits lack to render.
pub(super) fn lacks(limits: &wgpu::Limits) -> Vec<String> {
    let mut lacks = Vec::new();
    wgpu::Limits::defaults().check_limits_with_fail_fn(limits, false, |name, wanted, found| {
        lacks.push(format!("{name} of {wanted} (it has {found})"));
    });
    lacks
}

/// How soon an adapter is chosen: lower is sooner.
fn rank(adapter: &AdapterDescription) -> u32 {
    match adapter.kind {
        "discrete" => 0,
        "integrated" => 1,
        "virtual" => 2,
        "other" => 3,
        _ => 4,
    }
}

/// The number of a device that is named by it: `#2`, the second.
fn number_of(wanted: &str) -> Option<usize> {
    wanted.strip_prefix('#')?.parse().ok()
}

/// The adapter that some options ask for.
///
/// Errors: no adapter, none of that name, or what the chosen one lacks
pub(super) fn choose(options: &GpuOptions) -> Result<(AdapterDescription, wgpu::Adapter), Error> {
    let mut found: Vec<_> = (1..).zip(adapters().into_iter().map(|a| (describe(&a), a))).collect();
    found.sort_by_key(|(_, (description, _))| rank(description));
    let names = found.iter().map(|(_, (d, _))| d.name.as_str()).collect::<Vec<_>>().join(", ");
    let numbers = found.iter().map(|(number, (d, _))| format!("#{number} {}", d.name));
    let numbers = numbers.collect::<Vec<_>>().join(", ");
    let wanted = options.adapter.as_deref().unwrap_or("").to_lowercase();
    let is_wanted = |number: usize, d: &AdapterDescription| {
        let is_named = match number_of(&wanted) {
            Some(wanted) => number == wanted,
            None => d.name.to_lowercase().contains(&wanted),
        };
        is_named && (options.software || d.kind != "software")
    };
    let chosen = found.into_iter().find(|(number, (d, _))| is_wanted(*number, d));
    let chosen = chosen.map(|(_, chosen)| chosen);
    let (description, adapter) = chosen.ok_or_else(|| {
        refused(match (names.as_str(), wanted.as_str()) {
            ("", _) => "no graphics device found; install its Vulkan, Metal or DirectX 12 \
                        driver, or render with --backend cpu"
                .to_owned(),
            (names, "") => {
                let is_part = |c: char| c.is_alphanumeric() || "-_".contains(c);
                let part: String = names.chars().take_while(|&c| is_part(c)).collect();
                format!(
                    "no graphics device beside software drivers ({names}); name one, for example \
                     --set gpu.device={}, or render with --backend cpu",
                    part.to_lowercase()
                )
            }
            (names, wanted) => match number_of(wanted) {
                Some(_) => format!("no graphics device {wanted} that may render; found: {numbers}"),
                None => format!("no graphics device with {wanted:?} in its name; found: {names}"),
            },
        })
    })?;
    if let Some(lacks) = &description.lacks {
        let problem = format!("{} lacks {lacks}; render with --backend cpu", description.name);
        return Err(refused(problem));
    }
    Ok((description, adapter))
}

/// What an adapter is asked for.
pub(super) fn device_descriptor(
    adapter: &wgpu::Adapter,
    options: &GpuOptions,
) -> wgpu::DeviceDescriptor<'static> {
    let mut asked = wgpu::DeviceDescriptor {
        label: Some("manylight"),
        required_limits: wgpu::Limits::defaults(),
        ..Default::default()
    };
    let most = adapter.limits();
    if adapter.get_info().device_type == wgpu::DeviceType::Cpu {
        let lists = lists_with_last_loop(options.features);
        asked.required_limits.max_storage_buffers_per_shader_stage =
            lists.min(most.max_storage_buffers_per_shader_stage);
    }
    if options.base {
        return asked;
    }
    let features = options.features.offered_by(adapter.features(), &most);
    let limits = &mut asked.required_limits;
    if features.has(Feature::LargeLimits) {
        limits.max_storage_buffer_binding_size = most.max_storage_buffer_binding_size;
        limits.max_buffer_size = most.max_buffer_size;
        limits.max_texture_dimension_2d = most.max_texture_dimension_2d;
    }
    if features.has(Feature::Bindless) {
        let textures = most.max_binding_array_elements_per_shader_stage;
        limits.max_binding_array_elements_per_shader_stage = textures.min(MOST_TEXTURES);
        let lists = limits.max_storage_buffers_per_shader_stage;
        limits.max_storage_buffers_per_shader_stage = lists.max(LISTS_BESIDE_TEXTURES);
    }
    asked.required_features = features.wgpu();
    if features.has(Feature::RayQueries) {
        asked.required_limits = asked.required_limits.using_acceleration_structure_values(most);
        // SAFETY: acceleration structures are built once, from triangles and instances that stay
        // within their buffers and are finite, and are bound only after that; rays that a shader
        // asks for have a finite origin and direction and an end.
        asked.experimental_features = unsafe { wgpu::ExperimentalFeatures::enabled() };
    }
    asked
}

fn refused(problem: String) -> Error {
    Error::Device { problem }
}

//! The device of the tests.

use super::loops::{LAST_LOOP_GROUP, with_last_loop};
use super::{Access, Feature, Features, Gpu, GpuOptions, KernelInfo, SHADERS, SceneTraits, link};
use crate::error::Error;
use manylight_testing::{skip_without_device, skip_without_feature};
use std::sync::OnceLock;

/// A device with no more than every device has; without one the test at hand is skipped.
pub(crate) fn device() -> Option<&'static Gpu> {
    static DEVICE: OnceLock<Result<Gpu, Error>> = OnceLock::new();
    let options = GpuOptions { base: true, software: true, ..GpuOptions::default() };
    let opened = DEVICE.get_or_init(|| Gpu::open(&options)).as_ref();
    opened.inspect_err(|reason| skip_without_device(&reason.to_string())).ok()
}

/// A device with one thing that not every device offers; without one the test at hand is skipped.
pub(crate) fn device_with(feature: Feature) -> Option<Gpu> {
    let features = Features::only(feature);
    let options = GpuOptions { software: true, features, ..GpuOptions::default() };
    let opened = Gpu::open(&options).map_err(|e| e.to_string());
    let opened = opened.and_then(|gpu| match gpu.features() == features {
        true => Ok(gpu),
        false => Err(format!("{} does not offer {feature:?}", gpu.name())),
    });
    opened.inspect_err(|reason| skip_without_feature(reason)).ok()
}

/// Links, parses, validates and writes a kernel, and compares ports, records and workgroup with it:
/// in the form that every device can run, and in those for devices that offer more.
pub(crate) fn check_kernel(kernel: &KernelInfo) {
    let name = kernel.shader;
    let text = |features, traits| {
        link(kernel, SHADERS, features, traits)
            .unwrap_or_else(|e| panic!("{name} {features:?} {traits:?}: {e}"))
    };
    let full = text(Features::NONE, SceneTraits::ALL);
    for traits in SceneTraits::COMBINATIONS {
        let base = text(Features::NONE, traits);
        if traits != SceneTraits::ALL && base == full {
            continue;
        }
        check_text(kernel, &base, Features::NONE);
        for features in Feature::ALL.map(Features::only).into_iter().chain([Features::ALL]) {
            let text = text(features, traits);
            if text != base {
                check_text(kernel, &text, features);
            }
        }
    }
}

/// What the validator allows.
fn capabilities(features: Features) -> naga::valid::Capabilities {
    use naga::valid::Capabilities;
    let allowed = |feature| match feature {
        Feature::Subgroups => Capabilities::SUBGROUP | Capabilities::SUBGROUP_BARRIER,
        Feature::Half => Capabilities::SHADER_FLOAT16,
        Feature::Timestamps | Feature::LargeLimits => Capabilities::empty(),
        Feature::RayQueries => Capabilities::RAY_QUERY,
        Feature::Bindless => {
            Capabilities::TEXTURE_AND_SAMPLER_BINDING_ARRAY
                | Capabilities::TEXTURE_AND_SAMPLER_BINDING_ARRAY_NON_UNIFORM_INDEXING
        }
    };
    let chosen = Feature::ALL.into_iter().filter(|&f| features.has(f));
    chosen.fold(Capabilities::empty(), |all, f| all | allowed(f))
}

fn check_text(kernel: &KernelInfo, text: &str, features: Features) {
    check_bindings(kernel, text, features);
    check_bindings(kernel, &with_last_loop(kernel.shader, text).expect("a main"), features);
}

fn check_bindings(kernel: &KernelInfo, text: &str, features: Features) {
    let name = &format!("{} {features:?}", kernel.shader);
    let module = naga::front::wgsl::parse_str(text)
        .unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(text)));
    let flags = naga::valid::ValidationFlags::all();
    let mut validator = naga::valid::Validator::new(flags, capabilities(features));
    let info = validator
        .validate(&module)
        .unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(text)));
    check_writers(name, &module, &info, features);

    let entry = module.entry_points.iter().position(|e| e.name == "main");
    let entry = entry.unwrap_or_else(|| panic!("{name} has no entry point main"));
    assert_eq!(module.entry_points[entry].workgroup_size, kernel.workgroup, "{name}: workgroup");
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).expect("layout");
    let mut shared = 0;
    for (handle, variable) in module.global_variables.iter() {
        if let naga::AddressSpace::WorkGroup = variable.space {
            shared += layouter[variable.ty].size;
        }
        let Some(binding) = &variable.binding else { continue };
        if binding.group == LAST_LOOP_GROUP && variable.name.as_deref() == Some("last_loop") {
            continue;
        }
        if binding.group == 1 {
            let is_used = !info.get_entry_point(entry)[handle].is_empty();
            assert!(!is_used || kernel.scene, "{name} uses the scene but does not say so");
            continue;
        }
        let port = kernel.ports.get(binding.binding as usize);
        let port = port.unwrap_or_else(|| panic!("{name}: no port at {}", binding.binding));
        assert_eq!(variable.name.as_deref(), Some(port.name), "{name}: name of a port");
        check_port(name, port, variable, &module, &layouter);
    }
    assert!(shared <= 16_384, "{name} takes {shared} bytes of workgroup memory");
    let is_list = |p: &&super::Port| matches!(p.access, Access::Read | Access::Write);
    let lists = kernel.ports.iter().filter(is_list).count();
    let scene_lists = if kernel.scene { 4 } else { 0 };
    assert!(lists + scene_lists <= 8, "{name} binds {} lists", lists + scene_lists);
    let bound = module.global_variables.iter().filter_map(|(_, v)| v.binding.as_ref());
    let own = bound.filter(|b| b.group == 0).count();
    assert_eq!(own, kernel.ports.len(), "{name}: ports without a binding in the shader");
}

/// The shader can be written for Vulkan, Metal and DirectX 12; the form that every device can run
/// in a shader model that DirectX 12 compiles without a library of its own.
fn check_writers(
    name: &str,
    module: &naga::Module,
    info: &naga::valid::ModuleInfo,
    features: Features,
) {
    use naga::back::{hlsl, msl, spv};
    let vulkan = spv::Options { lang_version: (1, 4), ..spv::Options::default() };
    let words = spv::write_vec(module, info, &vulkan, None);
    assert!(!words.unwrap_or_else(|e| panic!("{name} in SPIR-V: {e}")).is_empty(), "{name}");

    let metal = msl::Options { lang_version: (2, 4), ..msl::Options::default() };
    let text = msl::write_string(module, info, &metal, &msl::PipelineOptions::default());
    let (text, info_of) = text.unwrap_or_else(|e| panic!("{name} in MSL: {e}"));
    for entry in &info_of.entry_point_names {
        let entry = entry.as_ref().unwrap_or_else(|e| panic!("{name} in MSL: {e}"));
        assert!(text.contains(entry.as_str()), "{name} in MSL has no {entry}");
    }

    let shader_model = match features {
        Features::NONE => hlsl::ShaderModel::V5_1,
        _ => hlsl::ShaderModel::V6_5,
    };
    let (mut text, pipeline) = (String::new(), hlsl::PipelineOptions::default());
    // As many as the layout of a scene would have.
    let array = hlsl::BindTarget { binding_array_size: Some(16), ..Default::default() };
    let is_array = |v: &naga::GlobalVariable| {
        matches!(module.types[v.ty].inner, naga::TypeInner::BindingArray { .. })
    };
    let arrays = module.global_variables.iter().filter(|(_, v)| is_array(v));
    let arrays = arrays.filter_map(|(_, v)| v.binding).map(|binding| (binding, array));
    let binding_map = arrays.collect();
    let direct_x = hlsl::Options { shader_model, binding_map, ..hlsl::Options::default() };
    let found = hlsl::Writer::new(&mut text, &direct_x, &pipeline).write(module, info, None);
    for entry in found.unwrap_or_else(|e| panic!("{name} in HLSL: {e}")).entry_point_names {
        let entry = entry.unwrap_or_else(|e| panic!("{name} in HLSL: {e}"));
        assert!(text.contains(&entry), "{name} in HLSL has no {entry}");
    }
}

fn check_port(
    name: &str,
    port: &super::Port,
    variable: &naga::GlobalVariable,
    module: &naga::Module,
    layouter: &naga::proc::Layouter,
) {
    if let naga::TypeInner::Image { dim, arrayed, class } = module.types[variable.ty].inner {
        let flat = dim == naga::ImageDimension::D2 && !arrayed;
        assert!(flat, "{name}: {} has more than two dimensions", port.name);
        let store = naga::ImageClass::Storage {
            format: naga::StorageFormat::Rgba16Float,
            access: naga::StorageAccess::STORE,
        };
        let sampled = naga::ImageClass::Sampled { kind: naga::ScalarKind::Float, multi: false };
        let expected = if port.access == Access::Store { store } else { sampled };
        assert_eq!(class, expected, "{name}: texture {}", port.name);
        let is_texture = matches!(port.access, Access::Texture | Access::Store);
        assert!(is_texture, "{name}: access of {}", port.name);
        return;
    }
    let access = match variable.space {
        naga::AddressSpace::Uniform => Access::Uniform,
        naga::AddressSpace::Storage { access } if access.contains(naga::StorageAccess::STORE) => {
            Access::Write
        }
        _ => Access::Read,
    };
    assert_eq!(access, port.access, "{name}: access of {}", port.name);
    let (item, stride) = match &module.types[variable.ty].inner {
        naga::TypeInner::Array { base, stride, .. } => (*base, *stride),
        _ => (variable.ty, layouter[variable.ty].to_stride()),
    };
    // A uniform may leave out the padding at its end.
    let size = match access {
        Access::Uniform => layouter[item].alignment.round_up(port.size as u32),
        _ => port.size as u32,
    };
    // Numbers of 16 bits are kept in half the bytes.
    let is_half = match module.types[item].inner {
        naga::TypeInner::Vector { scalar, .. } => scalar == naga::Scalar::F16,
        _ => false,
    };
    assert_eq!(stride * if is_half { 2 } else { 1 }, size, "{name}: bytes of {}", port.name);
    let naga::TypeInner::Struct { members, .. } = &module.types[item].inner else { return };
    let fields: Vec<_> = port.fields.iter().filter(|f| !f.0.starts_with('_')).collect();
    let shader: Vec<_> = members
        .iter()
        .map(|m| (m.name.as_deref().unwrap_or(""), m.offset as usize))
        .filter(|m| !m.0.starts_with('_'))
        .collect();
    let host: Vec<_> = fields.iter().map(|f| (f.0, f.1)).collect();
    assert_eq!(shader, host, "{name}: fields of {}", port.name);
}

//! The text of every shader.

macro_rules! shaders {
    ($($path:literal),* $(,)?) => {
        &[$(($path, include_str!(concat!("../", $path, ".wgsl")))),*]
    };
}

/// Path below `src`, without extension, and text.
pub const SHADERS: &[(&str, &str)] = shaders![
    "gpu/index",
    "gpu/scan_blocks",
    "gpu/scan_add",
    "math/sequence",
    "math/warp",
    "math/color",
    "bvh/traverse",
    "world/scene",
    "world/texture",
    "world/rays",
    "world/cast",
    "surface/octahedral",
    "surface/view",
    "surface/receivers",
    "surface/point",
    "vlight/vpl/record",
    "gather/grid/gpu/record",
    "emitter/sources",
    "emitter/sky",
    "emitter/surface",
    "emitter/punctual",
    "emitter/direct_sample",
    "emitter/emit",
    "emitter/probe",
    "shadow/shadow",
    "direct/lights",
    "direct/receiver",
    "direct/from_lights",
    "direct/from_sky",
    "vlight/vpl/gpu/state",
    "vlight/vpl/gpu/trace_paths",
    "vlight/vpl/gpu/advance",
    "vlight/vpl/gpu/append",
    "vlight/vpl/gpu/scale",
    "vlight/vpl/gpu/on_emitters",
    "vlight/vpl/gpu/find_emitters",
    "vlight/vpl/gpu/place_emitters",
    "gather/brute/record",
    "gather/brute/sum",
    "gather/brute/finish",
    "reference/path",
    "reference/trace",
    "reference/fold",
];

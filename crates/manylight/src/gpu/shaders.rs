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
    "gather/grid/gpu/params",
    "gather/grid/gpu/reach",
    "gather/grid/gpu/stats",
    "gather/grid/gpu/draws",
    "gather/grid/gpu/contribution",
    "gather/grid/gpu/tiles",
    "gather/grid/gpu/receiver_bounds",
    "gather/grid/gpu/descend",
    "gather/grid/gpu/search",
    "gather/grid/gpu/light",
    "gather/grid/gpu/pick",
    "gather/grid/gpu/draw",
    "gather/grid/gpu/target",
    "gather/grid/gpu/cloud",
    "gather/grid/gpu/shadow",
    "gather/grid/gpu/shadow_point",
    "gather/grid/gpu/resolve",
    "gather/grid/gpu/alpha_start",
    "gather/grid/gpu/alpha_runs",
    "gather/grid/gpu/alpha_ask",
    "gather/grid/gpu/alpha_count",
    "gather/grid/gpu/alpha_adjust",
];

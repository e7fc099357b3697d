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
];

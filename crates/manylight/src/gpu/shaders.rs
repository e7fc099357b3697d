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
    "surface/octahedral",
    "vlight/vpl/record",
    "gather/grid/gpu/record",
    "filter/taps",
    "filter/noisy",
    "filter/guides",
    "filter/guess",
    "filter/first",
    "filter/pass",
    "filter/split",
    "filter/temporal/reproject",
    "filter/temporal/accumulate",
    "composite/brdf",
    "composite/begin",
    "composite/gathered",
    "composite/beauty",
    "composite/exposure_count",
    "composite/exposure",
    "composite/tone",
];

// How many pixels have which luminance, in steps of the same ratio.

import package::gpu::index;
import package::math::color;

struct CountParams {
    pixels: u32,
}

@group(0) @binding(0) var<uniform> params: CountParams;
@group(0) @binding(1) var<storage, read> beauty: array<vec4f>;
// Counts of pixels, which commute.
@group(0) @binding(2) var<storage, read_write> histogram: array<atomic<u32>>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= params.pixels {
        return;
    }
    let value = luminance(beauty[index].rgb);
    // Only numbers that are positive, finite and not subnormal count: by their exponent.
    let bits = bitcast<u32>(value);
    let exponent = bits >> 23u;
    if exponent == 0u || exponent >= 255u {
        return;
    }
    let step = (log2(value) - LEAST_STOP) * STEPS_PER_STOP;
    atomicAdd(&histogram[u32(clamp(step, 0.0, f32(STEPS - 1u)))], 1u);
}

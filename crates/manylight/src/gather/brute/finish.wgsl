// The sums of a tile's receivers as planes of the picture; twin of Gathered::set_exact.

import package::gather::brute::record;
import package::gpu::index;
import package::math::color;

struct FinishParams {
    first_pixel: u32,
    pixels: u32,
}

@group(0) @binding(0) var<uniform> params: FinishParams;
@group(0) @binding(1) var<storage, read> sums: array<BruteSum>;
// W/m², and lights evaluated.
@group(0) @binding(2) var<storage, read_write> unshadowed: array<vec4f>;
// W/m²; the fourth is 0.
@group(0) @binding(3) var<storage, read_write> shadowed: array<vec4f>;
// Share that arrives by luminance, and its trust: 1.
@group(0) @binding(4) var<storage, read_write> ratios: array<vec2f>;

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
    let pixel = params.first_pixel + index;
    let sum = sums[index];
    unshadowed[pixel] = vec4f(sum.unshadowed, f32(sum.evals));
    shadowed[pixel] = vec4f(sum.shadowed, 0.0);
    var ratio = 1.0;
    if any(sum.unshadowed != vec3f(0.0)) {
        ratio = luminance(sum.shadowed) / max(luminance(sum.unshadowed), SMALLEST);
    }
    ratios[pixel] = vec2f(ratio, 1.0);
}

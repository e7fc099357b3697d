// One path per pixel of a tile, added to the sums of a block of samples.

import package::gpu::index;
import package::reference::path;

struct TraceParams {
    view: View,
    // Of the picture.
    seed: u32,
    // Which sample.
    sample: u32,
    bounces: u32,
    normal_maps: u32,
    // Pixels of the tile.
    first_pixel: u32,
    pixels: u32,
    // 1: the sums begin.
    begins: u32,
}

@group(0) @binding(0) var<uniform> params: TraceParams;
// One per pixel of the tile.
@group(0) @binding(1) var<storage, read_write> emission: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> direct: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> indirect: array<vec4f>;

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
    let width = params.view.width;
    let seed = hash_u32(params.seed ^ hash_u32(pixel ^ PIXEL_KEY));
    var sequence = new_sequence(seed, params.sample);
    let at = vec2u(pixel % width, pixel / width);
    let found =
        trace_path(params.view, at, params.bounces, params.normal_maps == 1u, &sequence);
    var sums = PathSample(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    if params.begins == 0u {
        sums = PathSample(emission[index].xyz, direct[index].xyz, indirect[index].xyz);
    }
    emission[index] = vec4f(sums.emission + found.emission, 0.0);
    direct[index] = vec4f(sums.direct + found.direct, 0.0);
    indirect[index] = vec4f(sums.indirect + found.indirect, 0.0);
}

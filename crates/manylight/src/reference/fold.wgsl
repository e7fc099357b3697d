// Adds the sums of a block of samples to those of the picture; the last time divides them.

import package::gpu::index;

struct FoldParams {
    first_pixel: u32,
    pixels: u32,
    // 1: the sums of the picture begin.
    begins: u32,
    // 1, and at the end one over the number of samples.
    scale: f32,
}

@group(0) @binding(0) var<uniform> params: FoldParams;
// Sums of the block, one per pixel of the tile.
@group(0) @binding(1) var<storage, read> emission: array<vec4f>;
@group(0) @binding(2) var<storage, read> direct: array<vec4f>;
@group(0) @binding(3) var<storage, read> indirect: array<vec4f>;
// Sums of the picture.
@group(0) @binding(4) var<storage, read_write> all_emission: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> all_direct: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> all_indirect: array<vec4f>;

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
    var sums = array<vec4f, 3>(emission[index], direct[index], indirect[index]);
    if params.begins == 0u {
        sums[0] += all_emission[pixel];
        sums[1] += all_direct[pixel];
        sums[2] += all_indirect[pixel];
    }
    all_emission[pixel] = sums[0] * params.scale;
    all_direct[pixel] = sums[1] * params.scale;
    all_indirect[pixel] = sums[2] * params.scale;
}

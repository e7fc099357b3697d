// The picture: direct + indirect + emission; twin of Layers::beauty.

import package::gpu::index;

struct BeautyParams {
    pixels: u32,
}

@group(0) @binding(0) var<uniform> params: BeautyParams;
@group(0) @binding(1) var<storage, read> direct: array<vec4f>;
@group(0) @binding(2) var<storage, read> indirect: array<vec4f>;
@group(0) @binding(3) var<storage, read> emissions: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> beauty: array<vec4f>;

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
    beauty[index] = vec4f(direct[index].rgb + indirect[index].rgb + emissions[index].rgb, 1.0);
}

// Irradiance of every receiver from sun, point and spot lights.

import package::direct::lights;
import package::direct::receiver;
import package::gpu::index;

struct LightParams {
    first: u32,
    end: u32,
    seed: u32,
}

@group(0) @binding(0) var<uniform> params: LightParams;
// World position, and depth: NO_SURFACE where there is none.
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
// Shading normal, and the packed geometric one.
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
// W/m²; the fourth is 0.
@group(0) @binding(3) var<storage, read_write> irradiance: array<vec4f>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let pixel = params.first + item_index(group, groups, local);
    if pixel >= params.end {
        return;
    }
    var sum = vec3f(0.0);
    if positions[pixel].w < NO_SURFACE {
        var sequence = new_sequence(hash_u32(params.seed ^ hash_u32(pixel)), 0u);
        sum = from_lights(bare_receiver(positions[pixel], normals[pixel]), &sequence);
    }
    irradiance[pixel] = vec4f(sum, 0.0);
}

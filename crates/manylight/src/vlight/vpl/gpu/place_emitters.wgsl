// The shining points drawn on emissive triangles, in the order of the draws.

import package::gpu::index;
import package::vlight::vpl::gpu::on_emitters;

@group(0) @binding(0) var<uniform> params: EmitterParams;
// Shining points before each, and all of them.
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
@group(0) @binding(2) var<storage, read_write> lights: array<Vpl>;
@group(0) @binding(3) var<storage, read_write> info: VplInfo;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index == 0u {
        info.count = offsets[params.count];
        info.path_count = select(0u, params.count, has_surface_emitter());
        info.missing = 0u;
        info.rounds = 0u;
    }
    if index >= params.count {
        return;
    }
    let first = offsets[index];
    if offsets[index + 1u] > first && first < arrayLength(&lights) {
        lights[first] = light_on_emitter(index, params).light;
    }
}

// Appends the lights of a batch's paths to the set, in path order.

import package::gpu::index;
import package::vlight::vpl::record;
import package::vlight::vpl::gpu::state;

struct AppendParams {
    // Lights wanted: a path takes part if fewer lie before it.
    count: u32,
    bounces: u32,
}

@group(0) @binding(0) var<uniform> params: AppendParams;
@group(0) @binding(1) var<uniform> state: TraceState;
@group(0) @binding(2) var<storage, read> offsets: array<u32>;
@group(0) @binding(3) var<storage, read> slots: array<Vpl>;
@group(0) @binding(4) var<storage, read_write> lights: array<Vpl>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let path = item_index(group, groups, local);
    if path >= state.batch {
        return;
    }
    let first = state.light_count + offsets[path];
    if first >= params.count {
        return;
    }
    let own = min(offsets[path + 1u] - offsets[path], params.bounces);
    for (var i = 0u; i < own; i++) {
        if first + i < arrayLength(&lights) {
            lights[first + i] = slots[path * params.bounces + i];
        }
    }
}

// Divides the lights by the number of their paths.

import package::gpu::index;
import package::vlight::vpl::record;

@group(0) @binding(0) var<uniform> info: VplInfo;
@group(0) @binding(1) var<storage, read_write> lights: array<Vpl>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index < min(info.count, arrayLength(&lights)) {
        lights[index].intensity *= 1.0 / f32(max(info.path_count, 1u));
    }
}

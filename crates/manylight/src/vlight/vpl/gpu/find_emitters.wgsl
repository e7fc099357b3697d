// Which of the points drawn on emissive triangles shine.

import package::gpu::index;
import package::vlight::vpl::gpu::on_emitters;

@group(0) @binding(0) var<uniform> params: EmitterParams;
// 1 where one shines.
@group(0) @binding(1) var<storage, read_write> shines: array<u32>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index < params.count {
        shines[index] = u32(light_on_emitter(index, params).found);
    }
}

// Empties the table of cells.
import package::gpu::index;

@group(0) @binding(0) var<storage, read_write> table: array<u32>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index < arrayLength(&table) {
        table[index] = NONE;
    }
}

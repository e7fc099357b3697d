// How many neighbors in the order part at each number of levels; twin of count_cells.
import package::gpu::index;
import package::gather::grid::gpu::build::extent;
import package::gather::grid::gpu::build::split;

@group(0) @binding(0) var<storage, read_write> extent: Extent;
@group(0) @binding(1) var<storage, read> items: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> splits: array<atomic<u32>>;

var<workgroup> own: array<atomic<u32>, LEVEL_ENTRIES>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    if local < LEVEL_ENTRIES {
        atomicStore(&own[local], 0u);
    }
    workgroupBarrier();
    let index = item_index(group, groups, local);
    let count = min(atomicLoad(&extent.count), arrayLength(&items));
    if index > 0u && index < count {
        let level = split_level(items[index - 1u].xy, items[index].xy);
        if level < LEVEL_ENTRIES {
            atomicAdd(&own[level], 1u);
        }
    }
    workgroupBarrier();
    if local < LEVEL_ENTRIES {
        atomicAdd(&splits[local], atomicLoad(&own[local]));
    }
}

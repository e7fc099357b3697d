// Sums of what the lights of each block share to the corners of their own level-1 cells, and of
// blocks of blocks.
import package::gpu::index;
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::build::share_points;

struct BlockParams {
    // Where blocks of blocks begin in the list.
    first_superblock: u32,
    // Whether they are what is summed up.
    is_super: u32,
}

@group(0) @binding(0) var<uniform> params: BlockParams;
@group(0) @binding(1) var<uniform> info: GridInfo;
@group(0) @binding(2) var<storage, read> points: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> blocks: array<array<f32, 8>>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let block = item_index(group, groups, local);
    let is_super = params.is_super != 0u;
    let place = block + select(0u, params.first_superblock, is_super);
    if place >= select(params.first_superblock, arrayLength(&blocks), is_super) {
        return;
    }
    let count = min(info.vpl_count, arrayLength(&points));
    let items = select(count, (count + BLOCK - 1u) / BLOCK, is_super);
    var sum: array<f32, 8>;
    for (var i = block * BLOCK; i < min(block * BLOCK + BLOCK, items); i++) {
        var share: array<f32, 8>;
        if is_super {
            share = blocks[i];
        } else {
            share = share_of_point(points[i]);
        }
        for (var c = 0u; c < 8u; c++) {
            sum[c] += share[c];
        }
    }
    blocks[place] = sum;
}

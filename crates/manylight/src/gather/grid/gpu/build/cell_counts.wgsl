// How many cells of each level begin in each block of sorted lights; by level, then by block.
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::build::top_level;

struct CellParams {
    blocks: u32,
}

@group(0) @binding(0) var<uniform> params: CellParams;
@group(0) @binding(1) var<uniform> info: GridInfo;
@group(0) @binding(2) var<storage, read> items: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> ranks: array<u32>;

// Lights by the highest level at which they begin a cell.
var<workgroup> found: array<atomic<u32>, LEVEL_ENTRIES>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    if local < LEVEL_ENTRIES {
        atomicStore(&found[local], 0u);
    }
    workgroupBarrier();
    for (var i = 0u; i < CELL_BLOCK / GROUP_X; i++) {
        let top = top_level(group.x * CELL_BLOCK + i * GROUP_X + local);
        atomicAdd(&found[top], 1u);
    }
    workgroupBarrier();
    if local >= 1u && local < LEVEL_ENTRIES - 1u {
        var sum = 0u;
        for (var level = local; level < LEVEL_ENTRIES; level++) {
            sum += atomicLoad(&found[level]);
        }
        ranks[(local - 1u) * params.blocks + group.x] = sum;
    }
}

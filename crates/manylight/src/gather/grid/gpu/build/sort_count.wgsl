// How often each digit occurs in each block of items; by digit, then by block.
import package::gather::grid::gpu::build::digit;

@group(0) @binding(0) var<uniform> params: SortParams;
@group(0) @binding(1) var<storage, read> count: array<u32>;
@group(0) @binding(2) var<storage, read> items: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> places: array<u32>;

var<workgroup> found: array<atomic<u32>, SORT_DIGITS>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    atomicStore(&found[local], 0u);
    workgroupBarrier();
    let end = min(count[0], params.capacity);
    for (var i = 0u; i < SORT_BLOCK / GROUP_X; i++) {
        let index = group.x * SORT_BLOCK + i * GROUP_X + local;
        if index < end {
            atomicAdd(&found[digit_of(items[index])], 1u);
        }
    }
    workgroupBarrier();
    places[local * params.blocks + group.x] = atomicLoad(&found[local]);
}

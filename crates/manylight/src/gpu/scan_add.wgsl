// Adds to every value the sum of all blocks before its own.

struct ScanParams {
    count: u32,
}

@group(0) @binding(0) var<uniform> params: ScanParams;
@group(0) @binding(1) var<storage, read> sums: array<u32>;
@group(0) @binding(2) var<storage, read_write> values: array<u32>;

const PER_INVOCATION = SCAN_BLOCK / GROUP_X;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let before = sums[group.x];
    for (var i = 0u; i < PER_INVOCATION; i++) {
        let index = group.x * SCAN_BLOCK + i * GROUP_X + local;
        if index < params.count {
            values[index] += before;
        }
    }
}

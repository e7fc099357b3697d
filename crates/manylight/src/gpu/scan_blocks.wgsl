// Exclusive prefix sums inside blocks of SCAN_BLOCK values, and the sum of each block.

struct ScanParams {
    count: u32,
}

@group(0) @binding(0) var<uniform> params: ScanParams;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;

const PER_INVOCATION = SCAN_BLOCK / GROUP_X;
var<workgroup> partial: array<u32, GROUP_X>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    // Each invocation adds up a run of its own.
    let first = group.x * SCAN_BLOCK + local * PER_INVOCATION;
    var own: array<u32, PER_INVOCATION>;
    var sum = 0u;
    for (var i = 0u; i < PER_INVOCATION; i++) {
        own[i] = sum;
        if first + i < params.count {
            sum += values[first + i];
        }
    }
    partial[local] = sum;

    // The sums of the runs before it, by doubling steps.
    for (var step = 1u; step < GROUP_X; step *= 2u) {
        workgroupBarrier();
        var before = 0u;
        if local >= step {
            before = partial[local - step];
        }
        workgroupBarrier();
        partial[local] += before;
    }
    workgroupBarrier();
    let before = partial[local] - sum;
    for (var i = 0u; i < PER_INVOCATION; i++) {
        if first + i < params.count {
            values[first + i] = before + own[i];
        }
    }
    if local == GROUP_X - 1u {
        sums[group.x] = before + sum;
    }
}

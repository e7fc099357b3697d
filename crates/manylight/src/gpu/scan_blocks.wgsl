// Exclusive prefix sums inside blocks of SCAN_BLOCK values, and the sum of each block.
import package::gpu::running;

struct ScanParams {
    count: u32,
}

@group(0) @binding(0) var<uniform> params: ScanParams;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> sums: array<u32>;

const PER_INVOCATION = SCAN_BLOCK / GROUP_X;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    // Each invocation adds up a run of its own.
    let place = place_of(local);
    let first = group.x * SCAN_BLOCK + place * PER_INVOCATION;
    var own: array<u32, PER_INVOCATION>;
    var sum = 0u;
    for (var i = 0u; i < PER_INVOCATION; i++) {
        own[i] = sum;
        if first + i < params.count {
            sum += values[first + i];
        }
    }
    let sums_of_runs = running_sum(place, sum);
    for (var i = 0u; i < PER_INVOCATION; i++) {
        if first + i < params.count {
            values[first + i] = sums_of_runs.x + own[i];
        }
    }
    if place == 0u {
        sums[group.x] = sums_of_runs.y;
    }
}

// Two signals, each into a list of its own.

import package::gpu::index;
import package::filter::kept;

struct SplitParams {
    pixels: u32,
    // Whether there is a second one.
    is_pair: u32,
}

@group(0) @binding(0) var<uniform> params: SplitParams;
// Mean and variance of each signal in turn.
@group(0) @binding(1) var<storage, read> signals: array<KeptPair>;
@group(0) @binding(2) var<storage, read_write> first: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> second: array<vec2f>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= params.pixels {
        return;
    }
    let signal = pair_of(signals[index]);
    first[index] = signal.xy;
    if params.is_pair != 0u {
        second[index] = signal.zw;
    }
}

// Counts the words of a list that are no finite number, and those below zero.
import package::gpu::index;

struct FaultParams {
    count: u32,
    stride: u32,
    other_words: u32,
    place: u32,
}

@group(0) @binding(0) var<uniform> params: FaultParams;
@group(0) @binding(1) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<storage, read_write> faults: array<atomic<u32>>;

const EXPONENT = 0x7f800000u;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= params.count || (params.other_words >> (index % params.stride) & 1u) == 1u {
        return;
    }
    // Comparisons of what is no number may be left out.
    let bits = words[index];
    if (bits & EXPONENT) == EXPONENT {
        atomicAdd(&faults[params.place], 1u);
    } else if bits >> 31u == 1u && bits << 1u != 0u {
        atomicAdd(&faults[params.place + 1u], 1u);
    }
}

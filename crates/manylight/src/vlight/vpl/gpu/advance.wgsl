// Counts the paths of the last batch that belong to the set, and decides on the next batch.
// One invocation.

import package::gpu::index;
import package::vlight::vpl::record;
import package::vlight::vpl::gpu::state;

struct AdvanceParams {
    // Lights wanted.
    count: u32,
    // Most paths of a batch.
    capacity: u32,
    // Paths after which to give up.
    limit: u32,
    // 1: nothing was traced before.
    first: u32,
}

@group(0) @binding(0) var<uniform> params: AdvanceParams;
// Lights before each path of the last batch, and after all.
@group(0) @binding(1) var<storage, read> offsets: array<u32>;
@group(0) @binding(2) var<storage, read_write> state: TraceState;
@group(0) @binding(3) var<storage, read_write> info: VplInfo;
// Workgroups for the next batch.
@group(0) @binding(4) var<storage, read_write> groups: array<array<u32, 3>>;

// Paths of the last batch that begin before the set is full.
fn paths_taken(batch: u32, wanted: u32) -> u32 {
    var low = 0u;
    var high = batch;
    for (var i = 0u; i < 32u && low < high; i++) {
        let middle = low + (high - low) / 2u;
        if offsets[middle] < wanted {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Paths that will probably do; the set is the same whatever their number.
fn next_batch(lights: u32, paths: u32) -> u32 {
    if lights >= params.count || paths >= params.limit {
        return 0u;
    }
    var batch = params.capacity;
    if paths == 0u {
        batch = max(params.count / 4u, FIRST_BATCH);
    } else if lights > 0u {
        let paths_per_light = f32(paths) / f32(lights);
        let guess = f32(params.count - lights) * paths_per_light * 1.02 + 256.0;
        batch = u32(min(guess, f32(params.capacity)));
    }
    return min(min(batch, params.capacity), params.limit - paths);
}

@compute @workgroup_size(GROUP_X)
fn main(@builtin(local_invocation_index) local: u32) {
    if local > 0u {
        return;
    }
    var now = state;
    if params.first == 1u {
        now = TraceState(0u, 0u, 0u);
        info.rounds = 0u;
    }
    if now.batch > 0u {
        info.rounds++;
        let taken = paths_taken(now.batch, params.count - now.light_count);
        now.light_count += offsets[taken];
        now.path_count += taken;
    }
    now.batch = next_batch(now.light_count, now.path_count);
    state = now;
    info.count = now.light_count;
    info.path_count = now.path_count;
    info.missing = select(0u, params.count - now.light_count, now.batch > 0u);
    let size = groups_for(now.batch, PATH_GROUP);
    groups[0] = array<u32, 3>(size.x, select(size.y, 0u, now.batch == 0u), size.z);
}

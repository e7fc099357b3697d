// Sets alpha, `is_done` where it is fixed, and empties the statistics.
import package::gather::grid::gpu::reach;
import package::gather::grid::gpu::stats;

@group(0) @binding(0) var<uniform> start: Reach;
@group(0) @binding(1) var<storage, read_write> reach: array<Reach>;
@group(0) @binding(2) var<storage, read_write> stats: array<GatherStats>;

@compute @workgroup_size(GROUP_X)
fn main(@builtin(local_invocation_index) local: u32) {
    if local == 0u {
        reach[0] = start;
        atomicStore(&stats[0].frontier, 0u);
        atomicStore(&stats[0].chunks, 0u);
    }
}

// Sets alpha; `is_done` where it is fixed.
import package::gather::grid::gpu::reach;

@group(0) @binding(0) var<uniform> start: Reach;
@group(0) @binding(1) var<storage, read_write> reach: array<Reach>;

@compute @workgroup_size(GROUP_X)
fn main(@builtin(local_invocation_index) local: u32) {
    if local == 0u {
        reach[0] = start;
    }
}

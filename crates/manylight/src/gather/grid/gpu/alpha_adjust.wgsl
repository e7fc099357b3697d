// Corrects alpha by the number of lights that were counted; twin of the loop in reach.rs.
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::reach;

struct Wanted {
    evals: u32,
}

@group(0) @binding(0) var<uniform> wanted: Wanted;
@group(0) @binding(1) var<uniform> info: GridInfo;
@group(0) @binding(2) var<storage, read> counts: array<u32>;
@group(0) @binding(3) var<storage, read_write> reach: array<Reach>;

var<workgroup> evals: atomic<u32>;

@compute @workgroup_size(GROUP_X)
fn main(@builtin(local_invocation_index) local: u32) {
    if local == 0u {
        atomicStore(&evals, 0u);
    }
    workgroupBarrier();
    atomicAdd(&evals, counts[local]);
    workgroupBarrier();
    if local > 0u || reach[0].is_done != 0u {
        return;
    }
    if info.level_count == 0u || reach[0].asked == 0u {
        reach[0].is_done = 1u;
        return;
    }
    let seen = max(atomicLoad(&evals), 1u);
    let factor = f32(wanted.evals) * f32(reach[0].asked) / f32(seen);
    let alpha = reach[0].alpha;
    let corrected = clamp(alpha * pow(factor, 1.0 / GROWTH), LEAST_ALPHA, MOST_ALPHA);
    let step = round(log2(corrected) * PER_DOUBLING);
    if step == round(log2(alpha) * PER_DOUBLING) {
        reach[0].is_done = 1u;
        return;
    }
    reach[0].alpha = exp2(step / PER_DOUBLING);
}

// The cube around the lights of a workgroup, by subgroups.
import package::gather::grid::gpu::build::extent;

// Joins what every invocation found, in the workgroup's `own`; a barrier must follow, and all
// invocations come here.
fn join_extent(low: vec3u, high: vec3u, count: u32) {
    // Brings subgroups together that came apart where lights were looked at.
    workgroupBarrier();
    let all_low = subgroupMin(low);
    let all_high = subgroupMax(high);
    let all_count = subgroupAdd(count);
    if subgroupExclusiveAdd(1u) > 0u {
        return;
    }
    for (var axis = 0u; axis < 3u; axis++) {
        atomicMin(&own.low[axis], all_low[axis]);
        atomicMax(&own.high[axis], all_high[axis]);
    }
    atomicAdd(&own.count, all_count);
}

// The cube around the lights of a workgroup.
import package::gather::grid::gpu::build::extent;

// Joins what every invocation found, in the workgroup's `own`; a barrier must follow.
fn join_extent(low: vec3u, high: vec3u, count: u32) {
    if count == 0u {
        return;
    }
    for (var axis = 0u; axis < 3u; axis++) {
        atomicMin(&own.low[axis], low[axis]);
        atomicMax(&own.high[axis], high[axis]);
    }
    atomicAdd(&own.count, count);
}

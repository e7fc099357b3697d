// Counts the receivers in each run of RUN pixels: a workgroup per run.
import package::gpu::index;

struct AskParams {
    pixels: u32,
    runs: u32,
}

@group(0) @binding(0) var<uniform> params: AskParams;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> runs: array<u32>;

var<workgroup> count: atomic<u32>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    if local == 0u {
        atomicStore(&count, 0u);
    }
    workgroupBarrier();
    let run = group.y * groups.x + group.x;
    let pixel = run * GROUP_X + local;
    if pixel < params.pixels && positions[pixel].w < NO_SURFACE {
        atomicAdd(&count, 1u);
    }
    workgroupBarrier();
    if local == 0u && run <= params.runs {
        runs[run] = atomicLoad(&count);
    }
}

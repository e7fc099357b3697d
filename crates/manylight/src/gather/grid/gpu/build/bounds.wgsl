// The bounds of all lights that take part.
import package::gpu::index;
import package::gather::grid::gpu::build::join_extent;

@group(0) @binding(0) var<uniform> vpl_info: VplInfo;
@group(0) @binding(1) var<storage, read> lights: array<Vpl>;
@group(0) @binding(2) var<storage, read_write> extent: Extent;

var<workgroup> own: Extent;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    if local < 3u {
        atomicStore(&own.low[local], 0xffffffffu);
        atomicStore(&own.high[local], 0u);
    }
    if local == 0u {
        atomicStore(&own.count, 0u);
    }
    workgroupBarrier();
    let index = item_index(group, groups, local);
    var low = vec3u(0xffffffffu);
    var high = vec3u(0u);
    var count = 0u;
    if index < min(vpl_info.count, arrayLength(&lights)) && is_valid(lights[index]) {
        let p = lights[index].position;
        low = vec3u(ordered(p.x), ordered(p.y), ordered(p.z));
        high = low;
        count = 1u;
    }
    join_extent(low, high, count);
    workgroupBarrier();
    if local < 3u {
        atomicMin(&extent.low[local], atomicLoad(&own.low[local]));
        atomicMax(&extent.high[local], atomicLoad(&own.high[local]));
    }
    if local == 0u {
        atomicAdd(&extent.count, atomicLoad(&own.count));
    }
}

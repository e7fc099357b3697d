// The crowded grid lights of level 1: a workgroup each, one after another where there are many.
import package::gather::grid::gpu::build::around_vertex;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read> octants: array<Octants>;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var<storage, read> points: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> lights: array<GridLight>;
@group(0) @binding(6) var<storage, read> crowded: array<u32>;

var<workgroup> sums: array<Moments, GROUP_X>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let count = min(crowded[0], arrayLength(&crowded) - 1u);
    for (var i = group.x; i < count; i += groups.x) {
        let index = crowded[1u + i];
        let vertex = vertex_of(lights[index]);
        var own: Moments;
        for (var octant = 0u; octant < 8u; octant++) {
            add_vpls(&own, octants[index].cells[octant], octant, vertex, local, GROUP_X);
        }
        sums[local] = own;
        // The first may write what the others have read of the light.
        storageBarrier();
        for (var half = GROUP_X / 2u; half > 0u; half /= 2u) {
            workgroupBarrier();
            if local < half {
                sums[local] = join(sums[local], sums[local + half]);
            }
        }
        if local == 0u {
            lights[index] = light_of(sums[0], lights[index], info.origin, cell_size(info, 1u));
        }
        workgroupBarrier();
    }
}

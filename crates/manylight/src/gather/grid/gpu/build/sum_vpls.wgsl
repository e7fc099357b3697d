// Grid lights of level 1 from the virtual lights around them; twin of sweep_vpls. Eight invocations
// a light; crowded ones are left to sum_crowded.
import package::gpu::index;
import package::gather::grid::gpu::build::around_vertex;
import package::gather::grid::gpu::build::octant_sums;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read> octants: array<Octants>;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var<storage, read> points: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> lights: array<GridLight>;
// How many are crowded, and which, in any order: none knows of the others.
@group(0) @binding(6) var<storage, read_write> crowded: array<atomic<u32>>;

var<workgroup> counts: array<u32, GROUP_X>;

// Virtual lights in the cells around the vertex of this invocation and of its neighbors.
fn count_around(own: u32, local: u32) -> u32 {
    counts[local] = own;
    workgroupBarrier();
    var count = 0u;
    for (var octant = 0u; octant < 8u; octant++) {
        count += counts[local / 8u * 8u + octant];
    }
    return count;
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let item = item_index(group, groups, local);
    let index = item / 8u;
    let octant = item % 8u;
    let is_there = index < info.levels[1].light_count && info.level_count > 0u;
    var cell = NONE;
    if is_there {
        cell = octants[index].cells[octant];
    }
    let is_crowded = count_around(lights_in(cell), local) > CROWDED;
    var own: Moments;
    if is_there && !is_crowded {
        add_vpls(&own, cell, octant, vertex_of(lights[index]), 0u, 1u);
    }
    let sum = sum_octants(own, local);
    if !is_there || octant != 0u {
        return;
    }
    if is_crowded {
        let place = 1u + atomicAdd(&crowded[0], 1u);
        if place < arrayLength(&crowded) {
            atomicStore(&crowded[place], index);
        }
    } else {
        lights[index] = light_of(sum, lights[index], info.origin, cell_size(info, 1u));
    }
}

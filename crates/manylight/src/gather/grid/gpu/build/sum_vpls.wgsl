// Grid lights of level 1 from the virtual lights around them; twin of sweep_vpls. One invocation a
// light; crowded ones are left to sum_crowded.
import package::gpu::index;
import package::gather::grid::gpu::build::around_vertex;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read> octants: array<Octants>;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var<storage, read> points: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> lights: array<GridLight>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= info.levels[1].light_count || info.level_count == 0u {
        return;
    }
    let around = octants[index].cells;
    if count_around(around) > CROWDED {
        return;
    }
    var sum: Moments;
    add_vpls(&sum, around, vertex_of(lights[index]), 0u, 1u);
    lights[index] = light_of(sum, lights[index], info.origin, cell_size(info, 1u));
}

// The vertex of every grid light and the cells around it.
import package::gpu::index;
import package::gather::grid::gpu::build::around;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> table: array<u32>;
@group(0) @binding(2) var<storage, read> owned: array<u32>;
@group(0) @binding(3) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(4) var<storage, read_write> lights: array<GridLight>;
@group(0) @binding(5) var<storage, read_write> octants: array<Octants>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= info.cell_count || info.level_count == 0u {
        return;
    }
    var light = owned[index];
    cells[index].first_owned = light;
    let flags = cells[index].octant_owned >> 8u;
    if flags == 0u {
        return;
    }
    var found = cells_around(index);
    let xy = cells[index].cell_xy;
    let z_lobe = cells[index].cell_z_lobe;
    for (var corner = 0u; corner < 8u; corner++) {
        if (flags >> corner & 1u) == 0u {
            continue;
        }
        lights[light].vertex_xy = xy + (corner & 1u) + ((corner >> 1u & 1u) << 16u);
        lights[light].vertex_z_lobe = z_lobe + (corner >> 2u);
        for (var octant = 0u; octant < 8u; octant++) {
            octants[light].cells[octant] = found[place_around(corner, octant)];
        }
        light++;
    }
}

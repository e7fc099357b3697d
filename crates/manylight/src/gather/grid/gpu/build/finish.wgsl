// Where the grid lights of each level lie. One invocation.
//
// Without room for all cells or lights there is no hierarchy; their numbers tell what it needs.
import package::gpu::index;
import package::gather::grid::gpu::record;

@group(0) @binding(0) var<storage, read> owned: array<u32>;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read> lights: array<GridLight>;
@group(0) @binding(3) var<storage, read_write> info: array<GridInfo>;
// Workgroups over the octants of all lights, and over those of each level.
@group(0) @binding(4) var<storage, read_write> groups: array<array<u32, 3>>;

fn write_groups(entry: u32, light_count: u32) {
    let n = groups_for(8u * light_count, OCTANT_GROUP);
    groups[entry] = array<u32, 3>(n.x, n.y, n.z);
}

@compute @workgroup_size(GROUP_X)
fn main() {
    let total = owned[min(info[0].cell_count, arrayLength(&owned) - 1u)];
    let is_whole = info[0].cell_count <= arrayLength(&cells) && total <= arrayLength(&lights);
    info[0].light_count = total;
    for (var level = 1u; level < LEVEL_ENTRIES; level++) {
        let place = info[0].levels[level];
        let most = arrayLength(&owned) - 1u;
        let first = owned[min(place.first_cell, most)];
        let end = owned[min(place.first_cell + place.cell_count, most)];
        let count = select(0u, end - first, level <= info[0].level_count);
        info[0].levels[level].first_light = first;
        info[0].levels[level].light_count = count;
        write_groups(level, select(0u, count, is_whole));
    }
    write_groups(0u, select(0u, total, is_whole));
    if !is_whole {
        info[0].level_count = 0u;
    }
}

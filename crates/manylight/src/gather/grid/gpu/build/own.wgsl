// Which of its corners each cell owns: those where it is the first in the list of the cells that
// share something to them.
import package::gpu::index;
import package::gather::grid::gpu::build::around;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> table: array<u32>;
@group(0) @binding(2) var<storage, read> shares: array<array<f32, 8>>;
@group(0) @binding(3) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(4) var<storage, read_write> owned: array<u32>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= arrayLength(&owned) {
        return;
    }
    owned[index] = 0u;
    if index >= min(info.cell_count, arrayLength(&cells)) || cells[index]._pad.x == 0u {
        return;
    }
    var found = cells_around(index);
    var flags = 0u;
    for (var corner = 0u; corner < 8u; corner++) {
        var first = NONE;
        for (var octant = 0u; octant < 8u; octant++) {
            let cell = found[place_around(corner, octant)];
            // Seen from the cell, the corner lies on the other side.
            if cell < first && shares[cell][7u - octant] > 0.0 {
                first = cell;
            }
        }
        flags |= select(0u, 1u << corner, first == index);
    }
    cells[index].octant_owned = (cells[index].octant_owned & 7u) | (flags << 8u);
    owned[index] = countOneBits(flags);
}

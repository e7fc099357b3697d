// The cells of one level and lobe around a cell; for kernels that bind `info`, `cells` and `table`.
import package::gather::grid::gpu::build::find;

fn find_cell(level: u32, lobe: u32, cell: vec3i) -> u32 {
    let most = i32(1u << (info.level_count - level));
    if any(cell < vec3i(0)) || any(cell >= vec3i(most)) {
        return NONE;
    }
    let at = vec3u(cell);
    let cell_xy = at.x | (at.y << 16u);
    let cell_z_lobe = at.z | (lobe << 16u);
    let size = arrayLength(&table);
    var slot = first_slot(level, cell_xy, cell_z_lobe, size);
    for (var i = 0u; i < MOST_PROBES; i++) {
        let index = table[slot];
        if index == NONE {
            return NONE;
        }
        if cells[index].cell_xy == cell_xy && cells[index].cell_z_lobe == cell_z_lobe
            && cells[index]._pad.x == level {
            return index;
        }
        slot = (slot + 1u) & (size - 1u);
    }
    return NONE;
}

// The 27 cells whose corners a cell touches, x first; NONE where there is none.
fn cells_around(index: u32) -> array<u32, 27> {
    let level = cells[index]._pad.x;
    let lobe = cells[index].cell_z_lobe >> 16u;
    let xy = cells[index].cell_xy;
    let here = vec3i(vec3u(xy & 0xffffu, xy >> 16u, cells[index].cell_z_lobe & 0xffffu));
    var found: array<u32, 27>;
    for (var i = 0u; i < 27u; i++) {
        let offset = vec3i(vec3u(i % 3u, i / 3u % 3u, i / 9u)) - vec3i(1);
        if i == 13u {
            found[i] = index;
        } else {
            found[i] = find_cell(level, lobe, here + offset);
        }
    }
    return found;
}

// Which of the 27 lies in an octant around a corner of the cell in the middle.
fn place_around(corner: u32, octant: u32) -> u32 {
    let x = (corner & 1u) + (octant & 1u);
    let y = (corner >> 1u & 1u) + (octant >> 1u & 1u);
    let z = (corner >> 2u) + (octant >> 2u);
    return x + 3u * y + 9u * z;
}

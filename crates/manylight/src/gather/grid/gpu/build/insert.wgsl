// Puts every cell into the table.
import package::gpu::index;
import package::gather::grid::gpu::build::find;

@group(0) @binding(0) var<uniform> info: GridInfo;
@group(0) @binding(1) var<storage, read> cells: array<Cell>;
@group(0) @binding(2) var<storage, read_write> table: array<atomic<u32>>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= min(info.cell_count, arrayLength(&cells)) {
        return;
    }
    let level = cells[index]._pad.x;
    if level == 0u {
        return;
    }
    let size = arrayLength(&table);
    var slot = first_slot(level, cells[index].cell_xy, cells[index].cell_z_lobe, size);
    for (var i = 0u; i < MOST_PROBES; i++) {
        let found = atomicCompareExchangeWeak(&table[slot], NONE, index);
        if found.exchanged {
            return;
        }
        // It may fail although the slot is free: then once more.
        if found.old_value != NONE {
            slot = (slot + 1u) & (size - 1u);
        }
    }
}

// What the cells of some levels share to their corners, and to those of the coarser cells around
// them; twin of share_of_cells and widen. More than one level takes a single workgroup.
import package::gpu::index;
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::build::share_points;

struct ShareParams {
    first_level: u32,
    last_level: u32,
    first_superblock: u32,
}

@group(0) @binding(0) var<uniform> params: ShareParams;
@group(0) @binding(1) var<uniform> info: GridInfo;
@group(0) @binding(2) var<storage, read> points: array<vec4f>;
@group(0) @binding(3) var<storage, read> blocks: array<array<f32, 8>>;
@group(0) @binding(4) var<storage, read_write> cells: array<Cell>;
@group(0) @binding(5) var<storage, read_write> shares: array<array<f32, 8>>;

fn add(a: array<f32, 8>, b: array<f32, 8>) -> array<f32, 8> {
    var sum = a;
    for (var c = 0u; c < 8u; c++) {
        sum[c] += b[c];
    }
    return sum;
}

// Of some lights of one cell: whole blocks where there are any.
fn share_of_lights(first: u32, end: u32) -> array<f32, 8> {
    var sum: array<f32, 8>;
    var i = first;
    while i < end {
        if i % SUPERBLOCK == 0u && i + SUPERBLOCK <= end {
            sum = add(sum, blocks[params.first_superblock + i / SUPERBLOCK]);
            i += SUPERBLOCK;
        } else if i % BLOCK == 0u && i + BLOCK <= end {
            sum = add(sum, blocks[i / BLOCK]);
            i += BLOCK;
        } else {
            sum = add(sum, share_of_point(points[i]));
            i++;
        }
    }
    return sum;
}

// What a cell shares to the corners of the coarser cell around it, from that to its own.
fn widen(own: array<f32, 8>, octant: u32) -> array<f32, 8> {
    var share = own;
    for (var axis = 0u; axis < 3u; axis++) {
        for (var low = 0u; low < 8u; low++) {
            if (low >> axis & 1u) != 0u {
                continue;
            }
            let high = low | (1u << axis);
            let a = share[low];
            let b = share[high];
            // The ends lie at 0 and ½ of the coarser cell, or at ½ and 1.
            let is_lower = (octant >> axis & 1u) == 0u;
            share[low] = select(0.5 * a, a + 0.5 * b, is_lower);
            share[high] = select(0.5 * a + b, 0.5 * b, is_lower);
        }
    }
    return share;
}

// Of a cell of a level.
fn share_of_cell(level: u32, index: u32) -> array<f32, 8> {
    if level == 1u {
        return share_of_lights(cells[index].light, cells[index + 1u].light);
    }
    var sum: array<f32, 8>;
    for (var i = cells[index].inner; i < cells[index + 1u].inner; i++) {
        sum = add(sum, cells[i].share);
    }
    return sum;
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let invocations = groups.x * groups.y * GROUP_X;
    let last_level = min(params.last_level, info.level_count);
    for (var level = params.first_level; level <= last_level; level++) {
        let place = info.levels[level];
        // Without room for all of them there will be no hierarchy.
        let is_whole = place.first_cell + place.cell_count < arrayLength(&cells);
        let count = select(0u, place.cell_count, is_whole);
        for (var item = item_index(group, groups, local); item < count; item += invocations) {
            let index = place.first_cell + item;
            let share = share_of_cell(level, index);
            shares[index] = share;
            cells[index].share = widen(share, cells[index].octant_owned & 7u);
        }
        // The next level reads what this one wrote.
        storageBarrier();
    }
}

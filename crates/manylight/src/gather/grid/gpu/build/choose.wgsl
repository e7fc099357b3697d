// The number of levels and where their cells lie; twin of choose_level_count. One invocation.
import package::gpu::index;
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::build::cube;
import package::gather::grid::gpu::build::extent;

struct ChooseParams {
    // 0 leaves the choice to the device.
    levels: u32,
    level_cap: u32,
    detail: f32,
    start_level: u32,
    cell_capacity: u32,
}

@group(0) @binding(0) var<uniform> params: ChooseParams;
@group(0) @binding(1) var<storage, read_write> extent: Extent;
@group(0) @binding(2) var<storage, read_write> splits: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> info: array<GridInfo>;
// Workgroups over all cells, then over the cells of each level.
@group(0) @binding(4) var<storage, read_write> groups: array<array<u32, 3>>;

fn write_groups(entry: u32, items: u32) {
    let n = groups_for(items, ITEM_GROUP);
    groups[entry] = array<u32, 3>(n.x, n.y, n.z);
}

@compute @workgroup_size(GROUP_X)
fn main() {
    let count = atomicLoad(&extent.count);
    var low: vec3f;
    var high: vec3f;
    for (var axis = 0u; axis < 3u; axis++) {
        low[axis] = from_ordered(atomicLoad(&extent.low[axis]));
        high[axis] = from_ordered(atomicLoad(&extent.high[axis]));
    }
    let cube = cube_around(low, high);
    // Occupied cells by number of levels.
    var cells: array<u32, LEVEL_ENTRIES>;
    var running = 1u;
    for (var level = 1u; level <= MAX_LEVELS; level++) {
        running += atomicLoad(&splits[level]);
        cells[level] = running;
    }
    var levels = clamp(params.levels, MIN_LEVELS, MAX_LEVELS);
    if params.levels == 0u {
        // Every cell has eight vertices, shared by two to four neighbors on a surface.
        for (var level = MIN_LEVELS; level <= MAX_LEVELS; level++) {
            if 2u * cells[level] < count / 2u {
                levels = level;
            }
        }
        while levels < MAX_LEVELS && cube.edge / f32(1u << (levels - 1u)) > params.detail {
            levels++;
        }
        levels = min(levels, max(params.level_cap, MIN_LEVELS));
    }
    levels = select(levels, 0u, count == 0u);
    info[0].origin = select(cube.origin, vec3f(0.0), count == 0u);
    info[0].edge = select(cube.edge, 1.0, count == 0u);
    info[0].level_count = levels;
    info[0].vpl_count = count;
    info[0].light_count = 0u;
    info[0].levels[0] = LevelInfo(0u, 0u, 0u, select(0u, count, params.start_level == 0u));
    var first = 0u;
    for (var level = 1u; level < LEVEL_ENTRIES; level++) {
        var own = 0u;
        if level <= levels {
            own = cells[levels + 1u - level];
        }
        info[0].levels[level] = LevelInfo(first, own, 0u, 0u);
        write_groups(level, select(0u, own, first + own <= params.cell_capacity));
        first += select(0u, own + 1u, level <= levels);
    }
    info[0].cell_count = first;
    write_groups(0u, min(first, params.cell_capacity));
}

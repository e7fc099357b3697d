// Writes the cells of all levels, by the light that is the first of each; twin of cells_of.
import package::gpu::running_words;
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::build::cube;
import package::gather::grid::gpu::build::top_level;

struct CellParams {
    blocks: u32,
}

@group(0) @binding(0) var<uniform> params: CellParams;
@group(0) @binding(1) var<uniform> info: GridInfo;
@group(0) @binding(2) var<storage, read> items: array<vec4u>;
@group(0) @binding(3) var<storage, read> ranks: array<u32>;
@group(0) @binding(4) var<storage, read_write> cells: array<Cell>;

const PER_INVOCATION = CELL_BLOCK / GROUP_X;
// Cells that begin at the lights of each invocation, two levels to a word.
const RUNNING_WORDS = LEVEL_ENTRIES / 2u;

fn write_cell(place: u32, level: u32, light: u32, inner: u32) {
    if place >= arrayLength(&cells) {
        return;
    }
    let depth = info.level_count - level;
    let key = items[light].xy;
    let code = shift_right(key, 3u * (MAX_LEVELS - 1u - depth));
    let position = position_of(code, depth);
    let lobe = key.y >> (3u * (MAX_LEVELS - 1u) - 32u);
    cells[place].inner = inner;
    cells[place].light = light;
    cells[place].octant_owned = code.x & 7u;
    cells[place].first_owned = 0u;
    cells[place].cell_xy = position.x | (position.y << 16u);
    cells[place].cell_z_lobe = position.z | (lobe << 16u);
    cells[place]._pad = vec2u(level, 0u);
}

// The end of a level.
fn write_sentinel(level: u32) {
    let place = info.levels[level].first_cell + info.levels[level].cell_count;
    if place >= arrayLength(&cells) {
        return;
    }
    let below = info.levels[level - 1u];
    cells[place].inner = select(below.first_cell + below.cell_count, 0u, level == 1u);
    cells[place].light = info.vpl_count;
    cells[place].octant_owned = 0u;
    cells[place].first_owned = 0u;
    cells[place].cell_xy = NONE;
    cells[place].cell_z_lobe = NONE;
    cells[place]._pad = vec2u(0u);
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let place = place_of(local);
    let first = group.x * CELL_BLOCK + place * PER_INVOCATION;
    var counts: array<u32, RUNNING_WORDS>;
    for (var i = 0u; i < PER_INVOCATION; i++) {
        let top = top_level(first + i);
        for (var level = 1u; level <= top; level++) {
            counts[level / 2u] += 1u << ((level & 1u) * 16u);
        }
    }
    var sums = sum_words(place, counts);
    // The next cell of each level; sentinels end the levels below.
    var next: array<u32, LEVEL_ENTRIES>;
    for (var level = 1u; level <= info.level_count; level++) {
        let lane = (level & 1u) * 16u;
        let before = (sums.before[level / 2u] >> lane) & 0xffffu;
        next[level] = ranks[(level - 1u) * params.blocks + group.x] + level - 1u + before;
    }
    for (var i = 0u; i < PER_INVOCATION; i++) {
        let top = top_level(first + i);
        for (var level = 1u; level <= top; level++) {
            let inner = select(next[level - 1u] - 1u, 0u, level == 1u);
            write_cell(next[level], level, first + i, inner);
            next[level]++;
        }
    }
    if group.x == 0u && local >= 1u && local <= info.level_count {
        write_sentinel(local);
    }
}

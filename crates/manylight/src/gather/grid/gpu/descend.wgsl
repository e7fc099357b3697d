// Going down the cells of the hierarchy, level by level and in order, to all lights that may give
// something to receivers in some bounds. One workgroup does it together.
//
// Reads `info`, `reach`, `params`, `cells`; works in `frontier`. The importing file says which
// lights it wants (`is_wanted`) and what becomes of them (`keep`).
import package::gpu::running;

// What is looked for in the cells at hand.
const CELLS = 0u;
const LIGHTS = 1u;
// Room for rounding in a lattice of 2^13 cells, in cells.
const LATTICE_SLACK = 0.01;

var<workgroup> starts: array<u32, GROUP_X>;
var<workgroup> ends: array<u32, GROUP_X>;
var<workgroup> found: array<u32, 2>;

// Whether nothing is missing in the lists.
fn is_whole() -> bool {
    return info.level_count > 0u && info.light_count <= arrayLength(&lights)
        && info.cell_count <= arrayLength(&cells) && info.vpl_count <= arrayLength(&vpls);
}

// Whether lights that a cell owns, or for level 0 its virtual lights, may lie in reach.
fn is_cell_near(cell: u32, level: u32, bounds: Bounds) -> bool {
    if level == info.level_count {
        return true;
    }
    let code = vec3u(cells[cell].cell_xy, cells[cell].cell_xy >> 16u, cells[cell].cell_z_lobe);
    let low = vec3f(code & vec3u(0xffffu));
    let size = cell_size(info, level);
    let gap_low = low - (bounds.high - info.origin) / size;
    let gap_high = (bounds.low - info.origin) / size - low - 1.0;
    // Owned lights lie within one cell of the corners.
    let beyond = select(1.0, 0.0, level == 0u);
    let gap = max(max(gap_low, gap_high) - (beyond + LATTICE_SLACK), vec3f(0.0));
    let outer = select(2.0 * reach.alpha, reach.alpha, level == 0u);
    return dot(gap, gap) < outer * outer * 1.001 + NEARER * MOST_VARIANCE;
}

// First and number of the things to look at in a cell of a level; for level 0 in one of level 1.
fn things_in(things: u32, level: u32, cell: u32, bounds: Bounds) -> vec2u {
    if things == CELLS {
        let first = cells[cell].inner;
        return vec2u(first, min(max(cells[cell + 1u].inner, first) - first, 8u));
    }
    if level > 0u {
        let owned = (cells[cell].octant_owned >> 8u) & 0xffu;
        return vec2u(cells[cell].first_owned, countOneBits(owned));
    }
    if !is_cell_near(cell, 0u, bounds) {
        return vec2u(0u);
    }
    let first = cells[cell].light;
    return vec2u(first, min(max(cells[cell + 1u].light, first), info.vpl_count) - first);
}

// The thing at a place of all things in the cells at hand.
fn thing_at(place: u32) -> u32 {
    var low = 0u;
    var count = GROUP_X - 1u;
    while count > 0u {
        let half = count / 2u;
        let is_behind = ends[low + half] <= place;
        low = select(low, low + half + 1u, is_behind);
        count = select(half, count - half - 1u, is_behind);
    }
    let before = select(ends[max(low, 1u) - 1u], 0u, low == 0u);
    return starts[low] + place - before;
}

// Looks at all things of one kind in the cells of a frontier; what is wanted goes on in order.
fn look_into(things: u32, level: u32, source: u32, count: u32, bounds: Bounds, group: u32,
    own_place: u32) {
    let target_start = frontier_start(group, 1u - source);
    for (var first = 0u; first < count; first += GROUP_X) {
        var range = vec2u(0u);
        if first + own_place < count {
            let cell = frontier[frontier_start(group, source) + first + own_place];
            range = things_in(things, level, cell, bounds);
        }
        let before = running_sum(own_place, range.y).x;
        starts[own_place] = range.x;
        ends[own_place] = before + range.y;
        let total = running_total();
        for (var base = 0u; base < total; base += GROUP_X) {
            var thing = 0u;
            var is_kept = false;
            if base + own_place < total {
                thing = thing_at(base + own_place);
                if things == CELLS {
                    is_kept = is_cell_near(thing, level - 1u, bounds);
                } else {
                    is_kept = is_wanted(level, thing, bounds);
                }
            }
            let place = place_of_kept(things, is_kept, own_place);
            if is_kept && things == LIGHTS {
                keep(place, level, thing);
            }
            if is_kept && things == CELLS && place < params.frontier_capacity {
                frontier[target_start + place] = thing;
            }
        }
    }
    // What one invocation wrote others read.
    storageBarrier();
}

fn frontier_start(group: u32, side: u32) -> u32 {
    return (group * 2u + side) * params.frontier_capacity;
}

// Place of this invocation's thing among all that were kept; counts them.
fn place_of_kept(things: u32, is_kept: bool, own_place: u32) -> u32 {
    let counts = running_count(own_place, is_kept);
    let first = found[things];
    workgroupBarrier();
    if own_place == 0u {
        found[things] = first + counts.y;
    }
    return first + counts.x;
}

// Goes down from the top; returns how many lights were kept, and how long the longest frontier
// would have been.
fn descend(bounds: Bounds, group: u32, local: u32) -> vec2u {
    let own_place = place_of(local);
    let top = info.level_count;
    var count = min(info.levels[top].cell_count, params.frontier_capacity);
    var longest = info.levels[top].cell_count;
    for (var i = local; i < count; i += GROUP_X) {
        frontier[frontier_start(group, 0u) + i] = info.levels[top].first_cell + i;
    }
    if local < 2u {
        found[local] = 0u;
    }
    storageBarrier();
    workgroupBarrier();
    var source = 0u;
    for (var level = top; level > 0u; level--) {
        look_into(LIGHTS, level, source, count, bounds, group, own_place);
        if level > 1u {
            look_into(CELLS, level, source, count, bounds, group, own_place);
            let next = workgroupUniformLoad(&found[CELLS]);
            if local == 0u {
                found[CELLS] = 0u;
            }
            longest = max(longest, next);
            count = min(next, params.frontier_capacity);
            source = 1u - source;
        }
    }
    if info.levels[0].light_count > 0u {
        look_into(LIGHTS, 0u, source, count, bounds, group, own_place);
    }
    return vec2u(workgroupUniformLoad(&found[LIGHTS]), longest);
}

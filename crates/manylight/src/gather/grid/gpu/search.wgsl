// The lights that can reach a block of receivers, in order: a workgroup per block. Twin of collect
// in tiles.rs.
//
// Runs twice: the first time it counts chunks, into the head of `candidates`, and keeps the lights
// themselves as far as there is room behind the frontiers; prefix sums turn the counts into places;
// the second time it copies the lights there, or looks for them again. What is left of a last chunk
// holds NO_LIGHT.
import package::gather::grid::gpu::params;
import package::gather::grid::gpu::tiles;
import package::gather::grid::gpu::receiver_bounds;
import package::gather::grid::gpu::descend;
import package::gather::grid::gpu::stats;

@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<uniform> reach: Reach;
@group(0) @binding(2) var<uniform> info: GridInfo;
@group(0) @binding(3) var<storage, read> positions: array<vec4f>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var<storage, read> cells: array<Cell>;
@group(0) @binding(6) var<storage, read> lights: array<GridLight>;
@group(0) @binding(7) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(8) var<storage, read_write> frontier: array<u32>;
@group(0) @binding(9) var<storage, read_write> candidates: array<u32>;
@group(0) @binding(10) var<storage, read_write> stats: array<GatherStats>;

// Where the list of this block begins, and its room: in `frontier` the first time, then in
// `candidates`.
var<private> list_start: u32;
var<private> list_room: u32;

// The block, for is_wanted.
var<private> own_block: vec2u;

fn is_wanted(level: u32, index: u32, bounds: Bounds) -> bool {
    let light = load_light(level, index);
    return is_seen_by_block(class_of(light, level)) && is_in_reach(light, level, bounds);
}

// Whether a tile of the block is of the class: where there are more classes than tiles, several
// blocks cover the same pixels.
fn is_seen_by_block(light_class: u32) -> bool {
    let classes = params.side * params.side;
    let in_order = (light_class + classes - params.first_class) % classes;
    let of_tile = vec2u(in_order % params.side, in_order / params.side);
    let turns = max(params.side / BLOCK_TILES, 1u);
    return light_class == EVERY || all(of_tile / BLOCK_TILES == own_block % turns);
}

fn write(place: u32, light: u32) {
    if place >= list_room {
        return;
    }
    if params.is_writing != 0u {
        candidates[list_start + place] = light;
    } else {
        frontier[list_start + place] = light;
    }
}

fn keep(place: u32, level: u32, index: u32) {
    write(place, (level << LEVEL_SHIFT) | index);
}

fn bounds_of_block(block: u32, local: u32) -> Bounds {
    var own = no_bounds();
    for (var i = local; i < BLOCK_PIXELS; i += GROUP_X) {
        let tile = block * TILES + i / (TILE * TILE);
        let pixel = pixel_index(pixel_position(tile, i % (TILE * TILE)));
        if pixel == NO_PIXEL || positions[pixel].w >= NO_SURFACE {
            continue;
        }
        let p = positions[pixel].xyz;
        let n = normals[pixel].xyz;
        own = join(own, Bounds(p, p, n, n));
    }
    return join_all(own, local);
}

var<workgroup> own_chunks: vec2u;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let block = group.x;
    let is_writing = params.is_writing != 0u;
    let kept_start = params.kept_start + block * params.kept_capacity;
    list_start = kept_start;
    list_room = params.kept_capacity;
    if is_writing {
        if local == 0u {
            own_chunks = vec2u(candidates[block], candidates[block + 1u]);
        }
        let chunks = workgroupUniformLoad(&own_chunks);
        let end = min(chunks.y, params.chunk_capacity);
        list_start = params.list_start + chunks.x * CHUNK;
        list_room = (max(end, chunks.x) - chunks.x) * CHUNK;
        if (chunks.y - chunks.x) * CHUNK <= params.kept_capacity {
            for (var i = local; i < list_room; i += GROUP_X) {
                candidates[list_start + i] = frontier[kept_start + i];
            }
            return;
        }
    }
    own_block = block_place(block);
    fill_shells(local);
    let bounds = bounds_of_block(block, local);
    var seen = vec2u(0u);
    if is_whole() && bounds.low.x <= bounds.high.x {
        seen = descend(bounds, block, local);
    }
    let chunk_count = (seen.x + CHUNK - 1u) / CHUNK;
    for (var i = seen.x + local; i < chunk_count * CHUNK; i += GROUP_X) {
        write(i, NO_LIGHT);
    }
    if !is_writing && local == 0u {
        candidates[block] = chunk_count;
        if block == 0u {
            candidates[params.block_count] = 0u;
        }
        atomicMax(&stats[0].frontier, seen.y);
    }
}

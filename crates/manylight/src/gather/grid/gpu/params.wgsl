// What all kernels of a gather know, and where their receivers lie; described in params.rs.

struct GatherParams {
    width: u32,
    height: u32,
    blocks_x: u32,
    first_block: u32,
    block_count: u32,
    frontier_capacity: u32,
    chunk_capacity: u32,
    list_start: u32,
    rays: u32,
    first_ray: u32,
    slice_rays: u32,
    flags: u32,
    shadow_start_level: u32,
    seed: u32,
    d_min_sq: f32,
    is_writing: u32,
}

struct Pick {
    light: u32,
    geometry: f32,
}

// No pixel of the picture.
const NO_PIXEL = 0xffffffffu;
const TILES = BLOCK_TILES * BLOCK_TILES;
const BLOCK_PIXELS = TILES * TILE * TILE;

// Position of a pixel in the picture, by its tile in the band and its place in the tile.
fn pixel_position(tile: u32, local: u32) -> vec2u {
    let block = params.first_block + tile / TILES;
    let corner = vec2u(block % params.blocks_x, block / params.blocks_x) * BLOCK_TILES;
    let in_block = tile % TILES;
    let corner_tile = corner + vec2u(in_block % BLOCK_TILES, in_block / BLOCK_TILES);
    return corner_tile * TILE + vec2u(local % TILE, local / TILE);
}

// Index of a pixel in the picture; NO_PIXEL outside.
fn pixel_index(p: vec2u) -> u32 {
    if p.x >= params.width || p.y >= params.height {
        return NO_PIXEL;
    }
    return p.y * params.width + p.x;
}

// Where a ray of a pixel lies in the list of a slice.
fn pick_place(tile: u32, local: u32, slice_ray: u32) -> u32 {
    return slice_ray * params.block_count * BLOCK_PIXELS + tile * TILE * TILE + local;
}

fn has_flag(flag: u32) -> bool {
    return (params.flags & flag) != 0u;
}

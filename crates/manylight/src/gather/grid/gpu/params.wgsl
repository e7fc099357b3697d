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
    side: u32,
    first_class: u32,
    kept_start: u32,
    kept_capacity: u32,
}

struct Pick {
    light: u32,
    geometry: f32,
}

// No pixel of the picture.
const NO_PIXEL = 0xffffffffu;
const TILES = BLOCK_TILES * BLOCK_TILES;
const BLOCK_PIXELS = TILES * TILE * TILE;

// Place of a block of the band among all of the picture.
fn block_place(block: u32) -> vec2u {
    let index = params.first_block + block;
    return vec2u(index % params.blocks_x, index / params.blocks_x);
}

// Place of a tile of the band among all of the picture.
fn tile_place(tile: u32) -> vec2u {
    let in_block = tile % TILES;
    return block_place(tile / TILES) * BLOCK_TILES
        + vec2u(in_block % BLOCK_TILES, in_block / BLOCK_TILES);
}

// Position of a pixel in the picture, by its tile in the band and its place in the tile.
fn pixel_position(tile: u32, local: u32) -> vec2u {
    let place = tile_place(tile);
    let corner = place / params.side * (params.side * TILE) + place % params.side;
    return corner + vec2u(local % TILE, local / TILE) * params.side;
}

// The lights that a tile sees; twin of Tile::class.
fn class_of_tile(tile: u32) -> u32 {
    let place = tile_place(tile) % params.side;
    return (place.x + params.side * place.y + params.first_class) % (params.side * params.side);
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

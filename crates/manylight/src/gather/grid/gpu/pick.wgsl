// Draws a light for every ray of a slice, by its share of the receiver's shadow weight. Twin of
// draw in walk.rs.
import package::gather::grid::gpu::params;
import package::gather::grid::gpu::draws;
import package::gather::grid::gpu::tiles;

@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<uniform> reach: Reach;
@group(0) @binding(2) var<uniform> info: GridInfo;
@group(0) @binding(3) var<storage, read> positions: array<vec4f>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var<storage, read> candidates: array<u32>;
@group(0) @binding(6) var<storage, read> masks: array<vec2u>;
@group(0) @binding(7) var<storage, read> weights: array<f32>;
@group(0) @binding(8) var<storage, read> lights: array<GridLight>;
@group(0) @binding(9) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(10) var<storage, read_write> picks: array<Pick>;

// The first chunk whose running weight lies above a target.
fn find_chunk(range: vec2u, in_block: u32, target_weight: f32) -> u32 {
    var low = range.x;
    var count = range.y - range.x - 1u;
    while count > 0u {
        let half = count / 2u;
        let is_behind = weights[(low + half) * BLOCK_PIXELS + in_block] <= target_weight;
        low = select(low, low + half + 1u, is_behind);
        count = select(half, count - half - 1u, is_behind);
    }
    return low;
}

// The light of a chunk at which what is left of the target is used up.
fn pick_in_chunk(chunk: u32, tile: u32, p: vec3f, n: vec3f, rest: f32) -> Pick {
    var drawn = Pick(PICK_NONE, 0.0);
    var left = rest;
    var mask = masks[chunk * TILES + tile % TILES];
    for (var i = 0u; i < CHUNK; i++) {
        if (mask.x | mask.y) == 0u {
            break;
        }
        var bit = countTrailingZeros(mask.x);
        if mask.x != 0u {
            mask.x &= mask.x - 1u;
        } else {
            bit = 32u + countTrailingZeros(mask.y);
            mask.y &= mask.y - 1u;
        }
        let candidate = candidates[params.list_start + chunk * CHUNK + bit];
        let level = candidate >> LEVEL_SHIFT;
        let light = tile_light(load_light(level, candidate & INDEX_MASK), level);
        let offset = light.position - p;
        let blended = blend(light.nearer, light.rise, light.fall, offset);
        if !(light.shadow_weight > 0.0 && blended > 0.0) {
            continue;
        }
        let g = geometry(light, offset, n, params.d_min_sq);
        let weight = light.shadow_weight * (blended * g);
        // Rounding may leave a rest behind the last light: it goes to the last one with a weight.
        if weight > 0.0 {
            drawn = Pick(candidate, g);
            if left < weight {
                break;
            }
            left -= weight;
        }
    }
    return drawn;
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    fill_shells(local);
    workgroupBarrier();
    let tile = group.x;
    let block = tile / TILES;
    let position = pixel_position(tile, local);
    let pixel = pixel_index(position);
    if pixel == NO_PIXEL {
        return;
    }
    let place = pick_place(tile, local, group.y);
    let range = min(
        vec2u(candidates[block], candidates[block + 1u]), vec2u(params.chunk_capacity));
    let in_block = (tile % TILES) * TILE * TILE + local;
    picks[place] = Pick(PICK_NOTHING, 0.0);
    if positions[pixel].w >= NO_SURFACE || range.x >= range.y {
        return;
    }
    let total = weights[(range.y - 1u) * BLOCK_PIXELS + in_block];
    if !(total > 0.0) {
        return;
    }
    let target_weight = draw_numbers(position, params.first_ray + group.y).x * total;
    let chunk = find_chunk(range, in_block, target_weight);
    var before = 0.0;
    if chunk > range.x {
        before = weights[(chunk - 1u) * BLOCK_PIXELS + in_block];
    }
    let p = positions[pixel].xyz;
    let n = normals[pixel].xyz;
    picks[place] = pick_in_chunk(chunk, tile, p, n, target_weight - before);
}

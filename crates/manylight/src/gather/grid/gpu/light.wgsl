// The sum of all lights at every receiver: a workgroup per tile, a receiver per invocation. Twin of
// narrow in tiles.rs and walk in walk.rs.
//
// For the draws it keeps which lights of a chunk reach the tile, and the running shadow weight of
// every receiver after every chunk.
import package::gather::grid::gpu::params;
import package::gather::grid::gpu::tiles;
import package::gather::grid::gpu::receiver_bounds;

@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<uniform> reach: Reach;
@group(0) @binding(2) var<uniform> info: GridInfo;
@group(0) @binding(3) var<storage, read> positions: array<vec4f>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var<storage, read> candidates: array<u32>;
@group(0) @binding(6) var<storage, read> lights: array<GridLight>;
@group(0) @binding(7) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(8) var<storage, read_write> masks: array<vec2u>;
@group(0) @binding(9) var<storage, read_write> weights: array<f32>;
@group(0) @binding(10) var<storage, read_write> unshadowed: array<vec4f>;

var<workgroup> chunk_range: vec2u;
var<workgroup> near: array<atomic<u32>, 2>;
var<workgroup> tile_lights: array<TileLight, CHUNK>;

// Puts the lights of a chunk that the tile sees and that reach it side by side; returns which. Its
// first barrier waits for those that still read the last chunk's.
fn narrow(chunk: u32, wanted: u32, bounds: Bounds, local: u32) -> vec2u {
    if local < 2u {
        atomicStore(&near[local], 0u);
    }
    workgroupBarrier();
    let candidate = candidates[params.list_start + chunk * CHUNK + local];
    let level = candidate >> LEVEL_SHIFT;
    var light: GridLight;
    var is_near = false;
    if candidate != NO_LIGHT {
        light = load_light(level, candidate & INDEX_MASK);
        is_near = is_of_class(light, level, wanted) && is_in_reach(light, level, bounds);
    }
    if is_near {
        atomicOr(&near[local / 32u], 1u << (local % 32u));
    }
    workgroupBarrier();
    let mask = vec2u(atomicLoad(&near[0]), atomicLoad(&near[1]));
    if is_near {
        let below = (1u << (local % 32u)) - 1u;
        let lower = select(0xffffffffu, below, local < 32u);
        let upper = select(below, 0u, local < 32u);
        let place = countOneBits(mask.x & lower) + countOneBits(mask.y & upper);
        tile_lights[place] = tile_light(light, level);
    }
    workgroupBarrier();
    return mask;
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let tile = group.x;
    let block = tile / TILES;
    let pixel = pixel_index(pixel_position(tile, local));
    var own = no_bounds();
    var p = vec3f(0.0);
    var n = vec3f(0.0);
    if pixel != NO_PIXEL && positions[pixel].w < NO_SURFACE {
        p = positions[pixel].xyz;
        n = normals[pixel].xyz;
        own = Bounds(p, p, n, n);
    }
    fill_shells(local);
    if local == 0u {
        chunk_range = min(
            vec2u(candidates[block], candidates[block + 1u]), vec2u(params.chunk_capacity));
    }
    let bounds = join_all(own, local);
    let wanted = class_of_tile(tile);
    let range = workgroupUniformLoad(&chunk_range);
    var sum = vec3f(0.0);
    var evals = 0.0;
    var weight = 0.0;
    if bounds.low.x <= bounds.high.x {
        for (var chunk = range.x; chunk < range.y; chunk++) {
            let mask = narrow(chunk, wanted, bounds, local);
            let count = countOneBits(mask.x) + countOneBits(mask.y);
            for (var i = 0u; i < count; i++) {
                let offset = tile_lights[i].position - p;
                let blended = blend(
                    tile_lights[i].nearer, tile_lights[i].rise, tile_lights[i].fall, offset);
                // Most of a tile lies on one side of a shell: the rest costs nothing there.
                if blended > 0.0 {
                    let light = tile_lights[i];
                    let share = blended * geometry(light, offset, n, params.d_min_sq);
                    sum += light.intensity * share;
                    evals += select(0.0, 1.0, share > 0.0);
                    weight += light.shadow_weight * share;
                }
            }
            weights[chunk * BLOCK_PIXELS + (tile % TILES) * TILE * TILE + local] = weight;
            if local == 0u {
                masks[chunk * TILES + tile % TILES] = mask;
            }
        }
    }
    if pixel != NO_PIXEL {
        let has_surface = own.low.x <= own.high.x;
        unshadowed[pixel] = select(vec4f(0.0), vec4f(sum, evals), has_surface);
    }
}

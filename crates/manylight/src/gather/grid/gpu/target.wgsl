// Draws a real virtual light inside every picked light, and weighs it; twin of ray_to_vpl in
// sample.rs without its ray.
//
// A pick's light becomes the position of the virtual light, with NEEDS_RAY where its visibility
// counts; its geometry becomes the weight.
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::params;
import package::gather::grid::gpu::draws;
import package::gather::grid::gpu::draw;
import package::vlight::vpl::record;

@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<uniform> info: GridInfo;
@group(0) @binding(2) var<storage, read_write> picks: array<Pick>;
@group(0) @binding(3) var<storage, read> positions: array<vec4f>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var<storage, read> cells: array<Cell>;
@group(0) @binding(6) var<storage, read> octants: array<Octants>;
@group(0) @binding(7) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(8) var<storage, read> points: array<vec4f>;
@group(0) @binding(9) var<storage, read> blocks: array<array<f32, 8>>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let position = pixel_position(group.x, local);
    let pixel = pixel_index(position);
    let place = pick_place(group.x, local, group.y);
    if pixel == NO_PIXEL {
        return;
    }
    let pick = picks[place];
    if pick.light == PICK_NONE || pick.light == PICK_NOTHING {
        return;
    }
    let level = pick.light >> LEVEL_SHIFT;
    var drawn = pick.light & INDEX_MASK;
    if level > 0u {
        drawn = draw(drawn, level, draw_numbers(position, params.first_ray + group.y).y);
    }
    let vpl = vpls[drawn];
    let p = positions[pixel].xyz;
    let n = normals[pixel].xyz;
    let own = vpl_geometry(vpl.position, vpl.normal, p, n, params.d_min_sq);
    let weight = min(own / pick.geometry, MOST_WEIGHT);
    let is_mean = !has_flag(WEIGHTED);
    let needs_ray = weight > 0.0 || is_mean;
    picks[place] = Pick(
        drawn | select(0u, NEEDS_RAY, needs_ray),
        select(weight, 1.0, is_mean),
    );
}

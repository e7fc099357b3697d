// A point drawn from the spread of every picked light (the paper's form); twin of ray_to_cloud in
// sample.rs without its ray.
//
// A pick loses the level of its light and weighs 1.
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::params;
import package::gather::grid::gpu::draws;
import package::vlight::vpl::record;

@group(0) @binding(0) var<uniform> params: GatherParams;
@group(0) @binding(1) var<uniform> info: GridInfo;
@group(0) @binding(2) var<storage, read_write> picks: array<Pick>;
@group(0) @binding(3) var<storage, read> lights: array<GridLight>;
@group(0) @binding(4) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(5) var<storage, read_write> targets: array<vec4f>;

// Sum of three uniforms: close to normal, bounded at three standard deviations.
fn next_normal(state: ptr<function, u32>) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < 3u; i++) {
        *state = hash_u32(*state + 0x9e3779b9u);
        sum += unit_f32(*state) * 2.0 - 1.0;
    }
    return sum;
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let position = pixel_position(group.x, local);
    if pixel_index(position) == NO_PIXEL {
        return;
    }
    let place = pick_place(group.x, local, group.y);
    let light = picks[place].light;
    if light == PICK_NONE || light == PICK_NOTHING {
        return;
    }
    let index = light & INDEX_MASK;
    let level = light >> LEVEL_SHIFT;
    picks[place] = Pick(index | NEEDS_RAY, 1.0);
    if level == 0u {
        targets[place] = vec4f(vpls[index].position, 0.0);
        return;
    }
    let ray = ray_index(position, params.first_ray + group.y);
    var state = hash_u32(params.seed ^ hash_u32(ray));
    let x = next_normal(&state);
    let y = next_normal(&state);
    let z = next_normal(&state);
    let size = cell_size(info, level);
    let known = lights[index].variance;
    let variance = select(vec3f(0.0), known, known >= vec3f(FLAT * size * size));
    targets[place] = vec4f(lights[index].position + vec3f(x, y, z) * sqrt(variance), 0.0);
}

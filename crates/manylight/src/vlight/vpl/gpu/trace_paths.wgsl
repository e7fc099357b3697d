// One light path per invocation, a virtual light at every hit; twin of trace_path in trace.rs.

import package::emitter::emit;
import package::gpu::index;
import package::math::color;
import package::math::sequence;
import package::math::warp;
import package::surface::point;
import package::vlight::vpl::record;
import package::vlight::vpl::gpu::state;
import package::world::rays;

struct PathParams {
    seed: u32,
    bounces: u32,
    normal_maps: u32,
}

@group(0) @binding(0) var<uniform> params: PathParams;
@group(0) @binding(1) var<uniform> state: TraceState;
// `bounces` of them to a path of the batch.
@group(0) @binding(2) var<storage, read_write> slots: array<Vpl>;
// Lights of each path.
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let path = item_index(group, groups, local);
    if path >= state.batch {
        return;
    }
    var sequence = new_sequence(params.seed, state.path_count + path);
    let emitted = emit(&sequence);
    var ray = Ray(emitted.origin, FAR_AWAY, emitted.direction);
    var flux = emitted.flux;
    var count = 0u;
    for (var bounce = 0u; bounce < params.bounces && emitted.found; bounce++) {
        if max_element(flux) <= 0.0 {
            break;
        }
        let hit = closest(ray);
        if hit.instance == NO_HIT {
            break;
        }
        let s = surface_at(hit, ray.direction, params.normal_maps == 1u);
        // Flux arrives by the geometric cosine, reflection asks for the shading one.
        let correction =
            min(dot(s.ns, ray.direction), 0.0) / min(dot(s.ng, ray.direction), -1e-6);
        flux *= s.albedo * min(correction, MAX_NORMAL_CORRECTION);
        if max_element(flux) <= 0.0 || !is_finite(flux) {
            break;
        }
        slots[path * params.bounces + count] = Vpl(s.position, s.ng, flux / PI);
        count += 1u;

        // Russian roulette on the albedo.
        let survival = min(max_element(s.albedo), 1.0);
        if next_1d(&sequence) >= survival {
            break;
        }
        flux /= survival;
        let direction = cosine_hemisphere(s.ng, next_2d(&sequence));
        ray = Ray(ray_origin(s), FAR_AWAY, direction);
    }
    counts[path] = count;
}

// Everything that is drawn from the sources, one point of a sequence per invocation.

import package::emitter::direct_sample;
import package::emitter::emit;

struct ProbeParams {
    count: u32,
    seed: u32,
}

@group(0) @binding(0) var<uniform> params: ProbeParams;
// Twelve to a point, as ProbeRecord.
@group(0) @binding(1) var<storage, read_write> found: array<array<vec4f, 12>>;

fn probed_emission(seed: u32, index: u32) -> array<vec4f, 3> {
    var sequence = new_sequence(seed, index);
    let ray = emit(&sequence);
    return array<vec4f, 3>(
        vec4f(ray.origin, select(0.0, 1.0, ray.found)),
        vec4f(ray.direction, 0.0),
        vec4f(ray.flux, 0.0),
    );
}

@compute @workgroup_size(GROUP_X)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.count {
        return;
    }
    let ray = probed_emission(params.seed, id.x);
    var sequence = new_sequence(params.seed, id.x);
    let u = next_2d(&sequence);
    let v = next_2d(&sequence);
    let s = surface_sample(u.x, v);
    let sky = sky_sample(u);
    let lights = sources[SOURCE_LIGHT_COUNT];
    let triangles = sources[SOURCE_TRIANGLE_COUNT];
    let p = mix(scene.bounds_low, scene.bounds_high, vec3f(v, u.y));
    var light = DirectSample(vec3f(0.0), 0.0, vec3f(0.0), false);
    if lights > 0u {
        light = direct_sample(id.x % lights, p);
    }
    found[id.x] = array<vec4f, 12>(
        ray[0],
        ray[1],
        ray[2],
        vec4f(s.position, select(0.0, 1.0, s.found)),
        vec4f(s.normal, s.pdf_area),
        vec4f(s.radiance, select(0.0, 1.0, s.double_sided)),
        vec4f(sky.direction, sky.pdf_sa),
        vec4f(sky.radiance, sky_pdf_sa(sky.direction)),
        vec4f(sky_radiance(uniform_sphere(v)), 0.0),
        vec4f(light.direction, light.distance),
        vec4f(light.irradiance, select(0.0, 1.0, light.found)),
        vec4f(
            f32(draw_source(sources[SOURCE_BY_FLUX], lights + 2u, u.x)),
            f32(draw_source(sources[SOURCE_TRIANGLES_BY_FLUX], triangles, u.x)),
            0.0,
            0.0,
        ),
    );
}

// Irradiance of every receiver from the sky, and the share of it that arrives; twin of from_sky
// in mod.rs.

import package::direct::receiver;
import package::emitter::sky;
import package::gpu::index;
import package::math::sequence;
import package::shadow::shadow;

struct SkyParams {
    first: u32,
    end: u32,
    width: u32,
    rays: u32,
    seed: u32,
    // 1: the irradiance is what arrives, and the share of it 1.
    exact: u32,
}

@group(0) @binding(0) var<uniform> params: SkyParams;
// World position, and depth: NO_SURFACE where there is none.
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
// Shading normal, and the packed geometric one.
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
// W/m²; the fourth is 0.
@group(0) @binding(3) var<storage, read_write> unshadowed: array<vec4f>;
// Share that arrives by luminance, and what its draws weigh: 1.
@group(0) @binding(4) var<storage, read_write> ratios: array<vec2f>;

struct SkyRay {
    direction: vec3f,
    irradiance: vec3f,
}

// One direction drawn in proportion to radiance · cosine, and its irradiance over its density.
fn resample_sky(ns: vec3f, sequence: ptr<function, Sequence>) -> SkyRay {
    var total = 0.0;
    var held = SkyRay(vec3f(0.0, 1.0, 0.0), vec3f(0.0));
    var held_weight = 1.0;
    for (var i = 0u; i < SKY_CANDIDATES; i++) {
        let sample = sky_sample(next_2d(sequence));
        let cosine = max(dot(ns, sample.direction), 0.0);
        // A texel without light, which only rounding can draw, gives nothing.
        let e = select(vec3f(0.0), sample.radiance * (cosine / sample.pdf_sa), sample.pdf_sa > 0.0);
        let weight = luminance(e);
        total += weight;
        if weight > 0.0 {
            if next_1d(sequence) * total < weight {
                held = SkyRay(sample.direction, e);
                held_weight = weight;
            }
        }
    }
    held.irradiance *= total / f32(SKY_CANDIDATES) / held_weight;
    return held;
}

fn sky_ray(ns: vec3f, sequence: ptr<function, Sequence>) -> SkyRay {
    if sky_is_map() {
        return resample_sky(ns, sequence);
    }
    let direction = cosine_hemisphere(ns, next_2d(sequence));
    return SkyRay(direction, sky_radiance(direction) * PI);
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let pixel = params.first + item_index(group, groups, local);
    if pixel >= params.end {
        return;
    }
    unshadowed[pixel] = vec4f(0.0);
    ratios[pixel] = vec2f(1.0);
    if !(positions[pixel].w < NO_SURFACE) {
        return;
    }
    let s = bare_receiver(positions[pixel], normals[pixel]);
    // Neighbors share one sequence.
    let first = morton_2d(pixel % params.width, pixel / params.width) * params.rays;
    var sum = vec3f(0.0);
    var seen = vec3f(0.0);
    for (var ray = 0u; ray < params.rays; ray++) {
        var sequence = new_sequence(params.seed, first + ray);
        let found = sky_ray(s.ns, &sequence);
        sum += found.irradiance;
        if max_element(found.irradiance) > 0.0 {
            if is_open(s, found.direction, FAR_AWAY) {
                seen += found.irradiance;
            }
        }
    }
    sum /= f32(max(params.rays, 1u));
    seen /= f32(max(params.rays, 1u));
    if params.exact == 1u {
        unshadowed[pixel] = vec4f(seen, 0.0);
        return;
    }
    unshadowed[pixel] = vec4f(sum, 0.0);
    if any(sum != vec3f(0.0)) {
        ratios[pixel].x = luminance(seen) / max(luminance(sum), SMALLEST);
    }
}

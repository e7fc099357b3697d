// Adds what was gathered from many lights to the layers; twin of add_direct and set_indirect.

import package::gpu::index;
import package::math::color;
import package::composite::brdf;

struct GatheredParams {
    pixels: u32,
    // Of this sample among all of a pixel.
    weight: f32,
    // Whether the lights are sources, and no surfaces that they light.
    is_direct: u32,
    // Whether what arrives is known in every channel.
    is_exact: u32,
}

@group(0) @binding(0) var<uniform> params: GatheredParams;
// Irradiance without visibility, lights evaluated.
@group(0) @binding(1) var<storage, read> gathered: array<vec4f>;
// Share that arrives.
@group(0) @binding(2) var<storage, read> ratios: array<vec2f>;
// Irradiance with visibility, where it is known in every channel.
@group(0) @binding(3) var<storage, read> shadowed: array<vec4f>;
@group(0) @binding(4) var<storage, read> albedos: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> direct: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> indirect: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> unshadowed: array<vec4f>;

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = item_index(group, groups, local);
    if index >= params.pixels {
        return;
    }
    let sum = gathered[index];
    let reflected = brdf(albedos[index].rgb) * params.weight;
    var ratio: f32;
    var arriving: vec3f;
    if params.is_exact != 0u {
        arriving = shadowed[index].rgb;
        ratio = exact_ratio(sum.rgb, arriving);
    } else {
        ratio = ratios[index].x;
        arriving = sum.rgb * ratio;
    }
    let light = reflected * arriving;
    let evals = sum.w * params.weight;
    if params.is_direct != 0u {
        direct[index] += vec4f(light, evals);
        return;
    }
    direct[index] += vec4f(0.0, 0.0, 0.0, evals);
    indirect[index] += vec4f(light, ratio * params.weight);
    unshadowed[index] += vec4f(reflected * sum.rgb, 0.0);
}

// Share of the light that arrives, by luminance; twin of Gathered::set_exact.
fn exact_ratio(without: vec3f, arriving: vec3f) -> f32 {
    let share = luminance(arriving) / max(luminance(without), LEAST_POSITIVE);
    return select(share, 1.0, all(without == vec3f(0.0)));
}

// Means over windows of pixels that know different parts of the lights; twin of join.

import package::math::color;
import package::surface::octahedral;

struct JoinParams {
    size: vec2u,
    // Pixels along the side of a window.
    side: u32,
}

@group(0) @binding(0) var<uniform> params: JoinParams;
@group(0) @binding(1) var<storage, read> guide_positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
// Irradiance, and anything.
@group(0) @binding(3) var<storage, read> parts: array<vec4f>;
// Share and trust.
@group(0) @binding(4) var<storage, read_write> shares: array<vec2f>;
@group(0) @binding(5) var<storage, read_write> joined: array<vec4f>;

// The middle of a window, moved so that it does not leave 0…size.
fn middle(at: u32, size: u32) -> u32 {
    let half = params.side / 2u;
    return select(at, clamp(at, half, max(size, half + 1u) - 1u - half), size > params.side);
}

// One more tap than parts: the outer two are of the same part.
fn kernel_at(i: u32) -> f32 {
    return select(1.0, 0.5, i == 0u || i == params.side);
}

// Light of a part of the lights as a share of what that of all is taken for.
fn share(part: vec3f, whole: vec3f) -> f32 {
    let y = luminance(whole);
    return select(1.0, min(luminance(part) / y, MOST_TRUST), y > 0.0);
}

// Sum over the window of the irradiance, and of the weights.
fn sum_window(pixel: vec2u, index: u32) -> vec4f {
    let here = guide_positions[index];
    let normal = normals[index];
    let plane_normal = unpack_octahedral(bitcast<u32>(normal.w));
    let scale = here.w * (2.0 / f32(params.side));
    let half = params.side / 2u;
    let first = vec2u(middle(pixel.x, params.size.x), middle(pixel.y, params.size.y));
    var sum = vec4f(0.0);
    for (var j = 0u; j <= params.side; j++) {
        for (var i = 0u; i <= params.side; i++) {
            let at = first + vec2u(i, j);
            if any(at < vec2u(half)) || any(at - half >= params.size) {
                continue;
            }
            let there = (at.y - half) * params.size.x + at.x - half;
            let other = guide_positions[there];
            if !(other.w > 0.0) {
                continue;
            }
            let cos_theta = max(dot(normal.xyz, normals[there].xyz), 0.0);
            let cos_sq = cos_theta * cos_theta;
            let plane = dot(plane_normal, other.xyz - here.xyz) * scale;
            let weight = kernel_at(i) * kernel_at(j) * (cos_sq * cos_sq) / (1.0 + plane * plane);
            sum += weight * vec4f(parts[there].rgb, 1.0);
        }
    }
    return sum;
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= params.size) {
        return;
    }
    let index = pixel.y * params.size.x + pixel.x;
    let part = parts[index];
    var whole = part.rgb;
    if guide_positions[index].w > 0.0 {
        let sum = sum_window(pixel.xy, index);
        if sum.w > 0.0 {
            whole = sum.rgb / sum.w;
        }
    }
    joined[index] = vec4f(whole, part.w);
    shares[index].y *= share(part.rgb, whole);
}

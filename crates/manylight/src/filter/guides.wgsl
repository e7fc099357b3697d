// What tells receivers apart; twin of guides.

import package::filter::kept;
import package::math::color;
import package::surface::octahedral;

struct GuideParams {
    // Eye point.
    origin: vec3f,
    // Side of a pixel is at_eye + per_depth · depth, metres.
    at_eye: f32,
    size: vec2u,
    per_depth: f32,
}

@group(0) @binding(0) var<uniform> params: GuideParams;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
@group(0) @binding(3) var<storage, read> albedos: array<vec4f>;
// Position from the eye, 1 / plane slack.
@group(0) @binding(4) var<storage, read_write> guide_positions: array<vec4f>;
// Unit geometric normal, luminance of the albedo.
@group(0) @binding(5) var<storage, read_write> guide_normals: array<KeptNormal>;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= params.size) {
        return;
    }
    let index = pixel.y * params.size.x + pixel.x;
    let position = positions[index];
    let depth = position.w;
    if !(depth < NO_SURFACE) {
        guide_positions[index] = vec4f(0.0);
        guide_normals[index] = keep_normal(vec4f(0.0));
        return;
    }
    let p = position.xyz - params.origin;
    let farthest = max_element(max(abs(position.xyz), abs(p)));
    let pixel_size = clamp(params.at_eye + params.per_depth * depth, 1e-7, 1e6);
    let slack = PLANE_SLACK * pixel_size + ROUNDING * farthest;
    let normal = unpack_octahedral(bitcast<u32>(normals[index].w));
    guide_positions[index] = vec4f(p, 1.0 / slack);
    let albedo = luminance(albedos[index].rgb);
    guide_normals[index] = keep_normal(vec4f(normal, albedo));
}

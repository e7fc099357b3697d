// Where the surfaces of this frame were in the last one; twin of Frame::find_taps. Keeps them for
// the next frame too.

import package::math::color;
import package::surface::octahedral;

struct ReprojectParams {
    // The last frame's view: eye point.
    eye: vec3f,
    is_perspective: u32,
    // Unit viewing direction.
    forward: vec3f,
    // Side of a pixel is at_eye + per_depth · depth, metres.
    at_eye: f32,
    // Axes of the picture, over half its extent at distance 1, or in metres if orthographic.
    right: vec3f,
    per_depth: f32,
    up: vec3f,
    // Whether there was a last frame.
    has_last: u32,
    // Where its rays met their pixels, from the top left corner.
    offset_px: vec2f,
    size: vec2u,
}

@group(0) @binding(0) var<uniform> params: ReprojectParams;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
// Bits of the position, packed geometric normal or NO_NORMAL.
@group(0) @binding(3) var<storage, read> last_surfaces: array<vec4u>;
@group(0) @binding(4) var<storage, read_write> surfaces: array<vec4u>;
// Corner of the taps, see pack_corner, and bits of the weights of three; the sum of four is 1.
@group(0) @binding(5) var<storage, read_write> motion: array<vec4u>;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= params.size) {
        return;
    }
    let index = pixel.y * params.size.x + pixel.x;
    let position = positions[index];
    if !(position.w < NO_SURFACE) {
        surfaces[index] = vec4u(0u, 0u, 0u, NO_NORMAL);
        motion[index] = vec4u(NO_TAPS, 0u, 0u, 0u);
        return;
    }
    let packed = bitcast<u32>(normals[index].w);
    surfaces[index] = vec4u(bitcast<vec3u>(position.xyz), packed);
    motion[index] = find_taps(position.xyz, unpack_octahedral(packed));
}

fn find_taps(p: vec3f, ng: vec3f) -> vec4u {
    let nothing = vec4u(NO_TAPS, 0u, 0u, 0u);
    if params.has_last == 0u {
        return nothing;
    }
    // Project the point; what lies behind the eye was not seen.
    let q = p - params.eye;
    let depth = dot(q, params.forward);
    var scale = 1.0;
    if params.is_perspective != 0u {
        if !(depth > 0.0) {
            return nothing;
        }
        scale = 1.0 / depth;
    }
    let size = vec2f(params.size);
    let x = dot(q, params.right) * scale;
    let y = dot(q, params.up) * scale;
    let point = vec2f(x + 1.0, 1.0 - y) * 0.5 * size - params.offset_px;
    if !(all(point > vec2f(-1.0)) && all(point < size)) {
        return nothing;
    }

    // The four nearest receivers, those on other surfaces left out.
    let corner = vec2i(floor(point));
    let share = point - floor(point);
    let pixel_size = clamp(params.at_eye + params.per_depth * depth, 1e-7, 1e6);
    let slack = PLANE_PIXELS * pixel_size + ROUNDING * max_element(abs(p));
    var weight = vec4f((1.0 - share.x), share.x, (1.0 - share.x), share.x)
        * vec4f(vec2f(1.0 - share.y), vec2f(share.y));
    for (var tap = 0; tap < 4; tap++) {
        if !is_same(corner + vec2i(tap % 2, tap / 2), p, ng, slack) {
            weight[tap] = 0.0;
        }
    }
    let total = weight.x + weight.y + weight.z + weight.w;
    if !(total > LEAST_TAPS) {
        return nothing;
    }
    return vec4u(pack_corner(corner), bitcast<vec3u>(weight.xyz / total));
}

// Whether a receiver of the last frame lies on the surface around a point.
fn is_same(at: vec2i, p: vec3f, ng: vec3f, slack: f32) -> bool {
    if any(at < vec2i(0)) || any(at >= vec2i(params.size)) {
        return false;
    }
    let seen = last_surfaces[at.y * i32(params.size.x) + at.x];
    if seen.w == NO_NORMAL {
        return false;
    }
    let plane = abs(dot(ng, bitcast<vec3f>(seen.xyz) - p));
    return dot(ng, unpack_octahedral(seen.w)) > NORMAL_COS && plane < slack;
}

// Both coordinates may be −1.
fn pack_corner(corner: vec2i) -> u32 {
    let code = vec2u(corner + 1);
    return code.x | (code.y << 16u);
}

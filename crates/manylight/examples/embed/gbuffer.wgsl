// What the camera sees, by rasterization.

struct View {
    eye: vec3f,
    near: f32,
    forward: vec3f,
    _pad0: f32,
    // Of length 1 over half the picture's extent at distance 1.
    right: vec3f,
    _pad1: f32,
    up: vec3f,
    _pad2: f32,
}

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) @interpolate(flat) face_normal: vec3f,
    @location(3) albedo: vec3f,
    // 1 in the fourth: of both sides.
    @location(4) @interpolate(flat) emission: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;

@vertex
fn corner(
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) face_normal: vec3f,
    @location(3) albedo: vec3f,
    @location(4) emission: vec4f,
) -> Corner {
    let q = position - view.eye;
    // Depth runs from 1 at the near plane to 0 far away.
    let clip = vec4f(dot(q, view.right), dot(q, view.up), view.near, dot(q, view.forward));
    return Corner(clip, position, normal, face_normal, albedo, emission);
}

struct Surface {
    @location(0) position_depth: vec4f,
    @location(1) albedo: vec4f,
    @location(2) emission: vec4f,
}

@fragment
fn surface(in: Corner) -> Surface {
    let depth = dot(in.position - view.eye, view.forward);
    let is_lit_side = is_front(in) || in.emission.w > 0.0;
    let emission = select(vec3f(0.0), in.emission.rgb, is_lit_side);
    return Surface(vec4f(in.position, depth), vec4f(in.albedo, 1.0), vec4f(emission, 1.0));
}

struct Normals {
    @location(0) normal: vec4f,
    @location(1) face_normal: vec4f,
}

@fragment
fn normals(in: Corner) -> Normals {
    let side = select(-1.0, 1.0, is_front(in));
    return Normals(vec4f(normalize(in.normal) * side, 0.0), vec4f(in.face_normal * side, 0.0));
}

fn is_front(in: Corner) -> bool {
    return dot(in.face_normal, in.position - view.eye) <= 0.0;
}

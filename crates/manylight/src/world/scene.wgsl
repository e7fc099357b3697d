// The scene in group 1, as world/gpu/mod.rs lays it out.
import package::world::bound;

struct SceneInfo {
    bounds_low: vec3f,
    diagonal: f32,
    bounds_high: vec3f,
    // Words of `geometry` at which the tables begin.
    instances: u32,
    meshes: u32,
    materials: u32,
    slots: u32,
    placements: u32,
    // Instances of shared meshes, and the root of the hierarchy over their boxes.
    placement_count: u32,
    placement_root: u32,
    // First of that hierarchy's items, in words of `geometry`.
    placement_items: u32,
    flat_count: u32,
}

// Five to a node.
@group(1) @binding(1) var<storage, read> bvh_nodes: array<vec4u>;
// Three to a triangle: corner and instance, edge and triangle, edge and twice its place in the
// builder's list, one more if opaque.
@group(1) @binding(2) var<storage, read> bvh_triangles: array<vec4f>;
@group(1) @binding(3) var<storage, read> geometry: array<u32>;
@group(1) @binding(4) var<storage, read> sources: array<u32>;
// Radiance of each texel of the sky's map, and what emitter/sky.wgsl says.
@group(1) @binding(7) var sky_texels: texture_2d<u32>;

const NONE = 0xffffffffu;

fn geometry_f32(at: u32) -> f32 {
    return bitcast<f32>(geometry[at]);
}

fn geometry_vec2(at: u32) -> vec2f {
    return bitcast<vec2f>(vec2u(geometry[at], geometry[at + 1u]));
}

fn geometry_vec3(at: u32) -> vec3f {
    return bitcast<vec3f>(vec3u(geometry[at], geometry[at + 1u], geometry[at + 2u]));
}

fn geometry_vec4(at: u32) -> vec4f {
    return bitcast<vec4f>(
        vec4u(geometry[at], geometry[at + 1u], geometry[at + 2u], geometry[at + 3u]));
}

// A 3 × 3 matrix of which the columns follow each other.
fn geometry_mat3(at: u32) -> mat3x3f {
    return mat3x3f(geometry_vec3(at), geometry_vec3(at + 3u), geometry_vec3(at + 6u));
}

// Words of an instance: linear part (9), translation (3), normal matrix (9), mesh, sign of the
// determinant.
fn instance_at(instance: u32) -> u32 {
    return scene.instances + instance * INSTANCE_WORDS;
}

// Words of a mesh: material, then where its lists begin: triangles, positions, normals, tangents,
// two sets of texture coordinates, colors; NONE where there are none.
fn mesh_at(instance: u32) -> u32 {
    return scene.meshes + geometry[instance_at(instance) + 21u] * MESH_WORDS;
}

// Words of a material: base color (4), emission (3), alpha mode, cutoff, scale of normals, flags,
// slots of base color, emission and normals, NONE where there are none.
fn material_at(instance: u32) -> u32 {
    return scene.materials + geometry[mesh_at(instance)] * MATERIAL_WORDS;
}

// How far a ray must start above a surface at `p` to leave it behind.
fn ray_offset(p: vec3f) -> f32 {
    return max(abs(p.x), max(abs(p.y), abs(p.z))) * 8e-6 + scene.diagonal * 2.5e-7;
}

// The barycentrics of a hit, a little inside the triangle; twin of Hit::inside.
fn inside(uv: vec2f) -> vec2f {
    let w = 1.0 - uv.x - uv.y;
    if min(min(uv.x, uv.y), w) >= EDGE_MARGIN {
        return uv;
    }
    let shares = max(vec3f(uv, w), vec3f(EDGE_MARGIN));
    return shares.xy / (shares.x + shares.y + shares.z);
}

// Vertex indices of a triangle.
fn triangle_vertices(mesh: u32, triangle: u32) -> vec3u {
    let at = geometry[mesh + 1u] + 3u * triangle;
    return vec3u(geometry[at], geometry[at + 1u], geometry[at + 2u]);
}

// Corners of a triangle, in object space.
fn object_corners(mesh: u32, vertices: vec3u) -> array<vec3f, 3> {
    let at = geometry[mesh + 2u];
    return array<vec3f, 3>(
        geometry_vec3(at + 3u * vertices.x),
        geometry_vec3(at + 3u * vertices.y),
        geometry_vec3(at + 3u * vertices.z),
    );
}

fn to_world(instance: u32, p: vec3f) -> vec3f {
    let at = instance_at(instance);
    return geometry_mat3(at) * p + geometry_vec3(at + 9u);
}

// Corners of a triangle in the world.
fn triangle_corners(instance: u32, triangle: u32) -> array<vec3f, 3> {
    let mesh = mesh_at(instance);
    let p = object_corners(mesh, triangle_vertices(mesh, triangle));
    return array<vec3f, 3>(
        to_world(instance, p[0]),
        to_world(instance, p[1]),
        to_world(instance, p[2]),
    );
}

// What a ray finds on a surface; twin of surface/mod.rs.
import package::math::color;
import package::math::warp;
import package::world::rays;

// A point on a surface, seen from one side.
struct SurfacePoint {
    position: vec3f,
    // Unit geometric normal on the side it is seen from, and shading normal in its hemisphere.
    ng: vec3f,
    ns: vec3f,
    albedo: vec3f,
    // Radiance toward this side.
    emission: vec3f,
    // Whether `emission` is mere display and lights nothing.
    unlit: bool,
}

// Start of a ray that leaves the surface on the seen side.
fn ray_origin(s: SurfacePoint) -> vec3f {
    return s.position + s.ng * ray_offset(s.position);
}

fn world_normal(instance: u32, normal: vec3f) -> vec3f {
    return normalize_or_zero(geometry_mat3(instance_at(instance) + 12u) * normal);
}

// Unit normal of the front side by corners in object space and in the world.
fn front_normal_of(instance: u32, p: array<vec3f, 3>, corners: array<vec3f, 3>) -> vec3f {
    let normal = world_normal(instance, cross(p[1] - p[0], p[2] - p[0]));
    if any(normal != vec3f(0.0)) {
        return normal;
    }
    // A singular transform has no cofactors left: take the flattened triangle itself.
    let flattened = normalize_or_zero(cross(corners[1] - corners[0], corners[2] - corners[0]));
    return select(vec3f(0.0, 1.0, 0.0), flattened, any(flattened != vec3f(0.0)));
}

// Unit normal of the front side of a triangle.
fn front_normal(instance: u32, triangle: u32) -> vec3f {
    let mesh = mesh_at(instance);
    let p = object_corners(mesh, triangle_vertices(mesh, triangle));
    return front_normal_of(instance, p, triangle_corners(instance, triangle));
}

// Radiance emitted by a point of a triangle on its emitting sides; textures included.
fn emission_at(instance: u32, triangle: u32, uv: vec2f) -> vec3f {
    let material = material_at(instance);
    let emission = geometry_vec3(material + 4u);
    let slot = geometry[material + 12u];
    if slot == NONE {
        return emission;
    }
    let mesh = mesh_at(instance);
    let coordinates = uv_at(mesh, slot, triangle_vertices(mesh, triangle), uv);
    return emission * sample_slot(slot, coordinates, true).rgb;
}

// World tangent along +u; handedness of the texture coordinates in w, 0 where there is none.
fn uv_tangent(mesh: u32, slot: u32, vertices: vec3u, corners: array<vec3f, 3>,
    front: vec3f) -> vec4f {
    let uv_set = geometry[scene.slots + slot * SLOT_WORDS + 8u];
    let list = geometry[mesh + 5u + min(uv_set, 1u)];
    if list == NONE {
        return vec4f(0.0);
    }
    let a = geometry_vec2(list + 2u * vertices.x);
    let d1 = geometry_vec2(list + 2u * vertices.y) - a;
    let d2 = geometry_vec2(list + 2u * vertices.z) - a;
    let determinant = d1.x * d2.y - d1.y * d2.x;
    if !(abs(determinant) > 0.0) {
        return vec4f(0.0);
    }
    let e1 = corners[1] - corners[0];
    let e2 = corners[2] - corners[0];
    let tangent = (e1 * d2.y - e2 * d1.y) * sign(determinant);
    // Rows of an image grow downward, the green channel points up: the bitangent follows −v.
    let winding = select(1.0, -1.0, dot(cross(e1, e2), front) < 0.0);
    return vec4f(tangent, -sign(determinant) * winding);
}

// Applies a tangent-space normal map.
fn bend_normal(instance: u32, mesh: u32, slot: u32, vertices: vec3u, uv: vec2f,
    corners: array<vec3f, 3>, front: vec3f, n: vec3f) -> vec3f {
    let texel = sample_slot(slot, uv_at(mesh, slot, vertices, uv), false).rgb * 2.0 - 1.0;
    var frame = vec4f(0.0);
    let list = geometry[mesh + 4u];
    if list == NONE {
        frame = uv_tangent(mesh, slot, vertices, corners, front);
    } else {
        let a = geometry_vec4(list + 4u * vertices.x);
        let b = geometry_vec4(list + 4u * vertices.y);
        let c = geometry_vec4(list + 4u * vertices.z);
        let t = a + (b - a) * uv.x + (c - a) * uv.y;
        let at = instance_at(instance);
        frame = vec4f(geometry_mat3(at) * t.xyz, t.w * geometry_f32(at + 22u));
    }
    let tangent = normalize_or_zero(frame.xyz - n * dot(n, frame.xyz));
    if all(tangent == vec3f(0.0)) {
        return n;
    }
    let side = select(1.0, -1.0, (bitcast<u32>(frame.w) >> 31u) == 1u);
    let bitangent = cross(n, tangent) * side;
    let scale = geometry_f32(material_at(instance) + 9u);
    let bent = normalize_or_zero(
        tangent * (texel.x * scale) + bitangent * (texel.y * scale) + n * texel.z);
    return select(n, bent, any(bent != vec3f(0.0)));
}

fn shading_normal(instance: u32, mesh: u32, vertices: vec3u, uv: vec2f, corners: array<vec3f, 3>,
    front: vec3f, normal_maps: bool) -> vec3f {
    var normal = front;
    let list = geometry[mesh + 3u];
    if list != NONE {
        let a = geometry_vec3(list + 3u * vertices.x);
        let b = geometry_vec3(list + 3u * vertices.y);
        let c = geometry_vec3(list + 3u * vertices.z);
        let smooth_normal = world_normal(instance, a + (b - a) * uv.x + (c - a) * uv.y);
        normal = select(front, smooth_normal, any(smooth_normal != vec3f(0.0)));
    }
    let slot = geometry[material_at(instance) + 13u];
    if normal_maps && slot != NONE {
        return bend_normal(instance, mesh, slot, vertices, uv, corners, front, normal);
    }
    return normal;
}

// Everything about the point a ray met; normals face the ray's origin.
fn surface_at(hit: Hit, direction: vec3f, normal_maps: bool) -> SurfacePoint {
    let instance = hit.instance;
    let mesh = mesh_at(instance);
    let material = material_at(instance);
    let vertices = triangle_vertices(mesh, hit.triangle);
    let p = object_corners(mesh, vertices);
    let corners = array<vec3f, 3>(
        to_world(instance, p[0]), to_world(instance, p[1]), to_world(instance, p[2]));
    let uv = inside(hit.uv);
    var s: SurfacePoint;
    s.position = corners[0] + (corners[1] - corners[0]) * uv.x + (corners[2] - corners[0]) * uv.y;

    // Normals, turned to the side the ray came from.
    let front = front_normal_of(instance, p, corners);
    let from_front = dot(front, direction) <= 0.0;
    s.ng = select(-front, front, from_front);
    let ns = shading_normal(instance, mesh, vertices, uv, corners, front, normal_maps);
    s.ns = select(ns, -ns, dot(ns, s.ng) < 0.0);

    // Color: factor, texture, vertex color.
    var color = geometry_vec3(material);
    let slot = geometry[material + 11u];
    if slot != NONE {
        color *= sample_slot(slot, uv_at(mesh, slot, vertices, uv), true).rgb;
    }
    color = clamp(color * vertex_color(mesh, vertices, uv).rgb, vec3f(0.0), vec3f(1.0));
    let flags = geometry[material + 10u];
    s.unlit = (flags & 1u) != 0u;
    if s.unlit {
        s.albedo = vec3f(0.0);
        s.emission = color;
        return s;
    }
    s.albedo = color;
    s.emission = vec3f(0.0);
    if from_front || (flags & 2u) != 0u {
        s.emission = emission_at(instance, hit.triangle, uv);
    }
    return s;
}

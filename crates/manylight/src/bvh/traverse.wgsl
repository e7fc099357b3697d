// One node of the hierarchy and one triangle against a ray.

// A half-open segment origin + t·direction, 0 < t < t_max.
struct Ray {
    origin: vec3f,
    t_max: f32,
    direction: vec3f,
}

// Where a ray met a triangle; `instance` is NO_HIT where it met none.
struct Hit {
    t: f32,
    // Barycentrics of the second and third corner.
    uv: vec2f,
    instance: u32,
    triangle: u32,
}

const NO_HIT = 0xffffffffu;
const FAR_AWAY = 3.4028235e38;

// What all nodes ask of a ray.
struct RaySetup {
    origin: vec3f,
    inverse: vec3f,
    // Flips the order of children so that nearer ones come first: 7 − octant of the direction.
    octant: u32,
}

fn is_finite_ray(ray: Ray) -> bool {
    let bits = max(bitcast<vec3u>(ray.origin) & vec3u(0x7f800000u),
        bitcast<vec3u>(ray.direction) & vec3u(0x7f800000u));
    return all(bits < vec3u(0x7f800000u));
}

fn setup_ray(ray: Ray) -> RaySetup {
    // A zero component must not make 0·∞ where the origin lies on a plane.
    let negative = (bitcast<vec3u>(ray.direction) >> vec3u(31u)) == vec3u(1u);
    let least = select(vec3f(1e-30), vec3f(-1e-30), negative);
    let direction = select(ray.direction, least, abs(ray.direction) < vec3f(1e-30));
    let octant = select(4u, 0u, direction.x < 0.0) | select(2u, 0u, direction.y < 0.0)
        | select(1u, 0u, direction.z < 0.0);
    return RaySetup(ray.origin, 1.0 / direction, octant);
}

// Children that wait for their visit: x is the first of a node's inner children, y has a bit per
// hit child from 24 on, by priority, and below the mask of inner slots. Of triangles, x is the
// first and y has a bit each.
struct Groups {
    nodes: vec2u,
    triangles: vec2u,
}

// Where a ray is at four planes of one axis, bytes of a word; scale and start as in visit_node.
fn at_planes(word: u32, scale: f32, start: f32) -> vec4f {
    return vec4f(unpack4xU8(word)) * scale + start;
}

// Planes of four children, a word for each axis.
struct Planes {
    near: vec3u,
    far: vec3u,
}

// The bits of four children among those of the node, of those that the ray enters before t_max;
// `slots`: a byte each that says where its bits go.
fn visit_four(planes: Planes, slots: u32, scale: vec3f, start: vec3f, octant: u32,
    t_max: f32) -> u32 {
    let near_x = at_planes(planes.near.x, scale.x, start.x);
    let near_y = at_planes(planes.near.y, scale.y, start.y);
    let near_z = at_planes(planes.near.z, scale.z, start.z);
    let far_x = at_planes(planes.far.x, scale.x, start.x);
    let far_y = at_planes(planes.far.y, scale.y, start.y);
    let far_z = at_planes(planes.far.z, scale.z, start.z);
    let enter = max(max(near_x, near_y), max(near_z, vec4f(0.0)));
    let leave = min(min(far_x, far_y), far_z);
    // A few roundings of the far side, so that a grazed box is never missed.
    let is_hit = enter <= min(leave * 1.000001, vec4f(t_max));
    let slot = unpack4xU8(slots);
    let is_inner = (slot & (slot << vec4u(1u)) & vec4u(0x10u)) != vec4u(0u);
    let place = (slot ^ select(vec4u(0u), vec4u(octant), is_inner)) & vec4u(0x1fu);
    let bits = select(vec4u(0u), (slot >> vec4u(5u)) << place, is_hit);
    return bits.x | bits.y | bits.z | bits.w;
}

// The children of a node that a ray enters before t_max. Source: [Ylitie17, Sec. 3.2 and 4.1]
//
// A node: origin, exponents of three axes and mask of inner slots; first child, first triangle,
// eight bytes that say where a child's bits go; then bytes of lower and upper planes per axis.
fn visit_node(n0: vec4u, n1: vec4u, n2: vec4u, n3: vec4u, n4: vec4u, s: RaySetup,
    t_max: f32) -> Groups {
    let exponents = vec3u(n0.w, n0.w >> 8u, n0.w >> 16u) & vec3u(0xffu);
    let scale = bitcast<vec3f>(exponents << vec3u(23u)) * s.inverse;
    let start = (bitcast<vec3f>(n0.xyz) - s.origin) * s.inverse;
    let backwards = s.inverse < vec3f(0.0);

    // Near and far planes per axis.
    let near_x = select(n2.xy, n2.zw, backwards.x);
    let far_x = select(n2.zw, n2.xy, backwards.x);
    let near_y = select(n3.xy, n3.zw, backwards.y);
    let far_y = select(n3.zw, n3.xy, backwards.y);
    let near_z = select(n4.xy, n4.zw, backwards.z);
    let far_z = select(n4.zw, n4.xy, backwards.z);

    let lower = Planes(vec3u(near_x.x, near_y.x, near_z.x), vec3u(far_x.x, far_y.x, far_z.x));
    let upper = Planes(vec3u(near_x.y, near_y.y, near_z.y), vec3u(far_x.y, far_y.y, far_z.y));
    let hits = visit_four(lower, n1.z, scale, start, s.octant, t_max)
        | visit_four(upper, n1.w, scale, start, s.octant, t_max);
    return Groups(vec2u(n1.x, (hits & 0xff000000u) | (n0.w >> 24u)), vec2u(n1.y, hits & 0xffffffu));
}

// Distance and barycentrics where a ray meets a triangle in 0 < t ≤ t_max; t < 0 where it does not.
//
// Source: [MoellerTrumbore97], edges stored
fn intersect_triangle(corner: vec3f, edge1: vec3f, edge2: vec3f, ray: Ray, t_max: f32) -> vec3f {
    let p = cross(ray.direction, edge2);
    let determinant = dot(edge1, p);
    let inverse = 1.0 / determinant;
    let s = ray.origin - corner;
    let u = dot(s, p) * inverse;
    let q = cross(s, edge1);
    let v = dot(ray.direction, q) * inverse;
    let t = dot(edge2, q) * inverse;
    // A determinant of zero makes numbers that are not, which a device may compare as it likes.
    let inside = u >= -EDGE_SLACK && v >= -EDGE_SLACK && u + v <= 1.0 + EDGE_SLACK;
    let is_hit = determinant != 0.0 && inside && t > 0.0 && t <= t_max;
    return select(vec3f(-1.0), vec3f(t, u, v), is_hit);
}

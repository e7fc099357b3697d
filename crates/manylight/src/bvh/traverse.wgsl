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

fn byte_of(words: vec2u, i: u32) -> u32 {
    return (select(words.x, words.y, i >= 4u) >> ((i & 3u) * 8u)) & 0xffu;
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

    var hits = 0u;
    for (var i = 0u; i < 8u; i++) {
        let near = vec3f(vec3u(byte_of(near_x, i), byte_of(near_y, i), byte_of(near_z, i)));
        let far = vec3f(vec3u(byte_of(far_x, i), byte_of(far_y, i), byte_of(far_z, i)));
        let enter = near * scale + start;
        let leave = far * scale + start;
        let t_enter = max(max(enter.x, enter.y), max(enter.z, 0.0));
        // A few roundings of the far side, so that a grazed box is never missed.
        let t_leave = min(min(leave.x, leave.y), leave.z) * 1.000001;
        if t_enter <= min(t_leave, t_max) {
            let slots = byte_of(n1.zw, i);
            let is_inner = (slots & (slots << 1u) & 0x10u) != 0u;
            let index = (slots ^ select(0u, s.octant, is_inner)) & 0x1fu;
            hits |= (slots >> 5u) << index;
        }
    }
    return Groups(vec2u(n1.x, (hits & 0xff000000u) | (n0.w >> 24u)), vec2u(n1.y, hits & 0xffffffu));
}

// Distance and barycentrics where a ray meets a triangle in 0 < t ≤ t_max; t < 0 where it does not.
//
// Source: [MoellerTrumbore97], edges stored
fn intersect_triangle(corner: vec3f, edge1: vec3f, edge2: vec3f, ray: Ray, t_max: f32) -> vec3f {
    let p = cross(ray.direction, edge2);
    let inverse = 1.0 / dot(edge1, p);
    let s = ray.origin - corner;
    let u = dot(s, p) * inverse;
    let q = cross(s, edge1);
    let v = dot(ray.direction, q) * inverse;
    let t = dot(edge2, q) * inverse;
    // A determinant of zero makes numbers that are not, for which comparisons are false.
    let inside = u >= -EDGE_SLACK && v >= -EDGE_SLACK && u + v <= 1.0 + EDGE_SLACK;
    return select(vec3f(-1.0), vec3f(t, u, v), inside && t > 0.0 && t <= t_max);
}

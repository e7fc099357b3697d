// Maps from the unit square to directions and surfaces; twins of warp.rs and frame.rs.

const PI = 3.14159265358979;

// Unit length, or zero where there is none.
fn normalize_or_zero(v: vec3f) -> vec3f {
    let scale = 1.0 / length(v);
    if scale > 0.0 && scale <= 3.4e38 {
        return v * scale;
    }
    return vec3f(0.0);
}

// Two unit vectors that complete `n` (unit) to a right-handed frame. Source: [Duff17, Listing 3]
struct TangentFrame {
    tangent: vec3f,
    bitangent: vec3f,
}

fn tangent_frame(n: vec3f) -> TangentFrame {
    // The sign bit, so that -0 counts as negative.
    let side = select(1.0, -1.0, (bitcast<u32>(n.z) >> 31u) == 1u);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    let tangent = vec3f(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    return TangentFrame(tangent, vec3f(b, side + n.y * n.y * a, -n.y));
}

// A direction around `n` with pdf_sa = cosθ/π.
fn cosine_hemisphere(n: vec3f, u: vec2f) -> vec3f {
    let frame = tangent_frame(n);
    let radius = sqrt(u.x);
    let phi = 2.0 * PI * u.y;
    let height = sqrt(max(1.0 - u.x, 0.0));
    return normalize(
        frame.tangent * (radius * cos(phi)) + frame.bitangent * (radius * sin(phi)) + n * height,
    );
}

// A direction with pdf_sa = 1/4π.
fn uniform_sphere(u: vec2f) -> vec3f {
    let z = 1.0 - 2.0 * u.x;
    let radius = sqrt(max(1.0 - z * z, 0.0));
    let phi = 2.0 * PI * u.y;
    return vec3f(radius * cos(phi), radius * sin(phi), z);
}

// A direction within acos(`cos_outer`) of `axis` with pdf_sa = 1/(2π(1 − cos_outer)).
fn uniform_cone(axis: vec3f, cos_outer: f32, u: vec2f) -> vec3f {
    let z = 1.0 - u.x * (1.0 - cos_outer);
    let radius = sqrt(max(1.0 - z * z, 0.0));
    let phi = 2.0 * PI * u.y;
    let frame = tangent_frame(axis);
    return frame.tangent * (radius * cos(phi)) + frame.bitangent * (radius * sin(phi)) + axis * z;
}

// Barycentrics (of the second and third vertex) with pdf_area = 1/area.
fn uniform_triangle(u: vec2f) -> vec2f {
    let root = sqrt(u.x);
    return vec2f(root * (1.0 - u.y), root * u.y);
}

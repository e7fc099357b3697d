// Maps from the unit square to directions and surfaces; twins of warp.rs and frame.rs.

const PI = 3.14159265358979;

// Unit length: by one division, as on the processor.
fn unit(v: vec3f) -> vec3f {
    return v * (1.0 / length(v));
}

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

// Sine and cosine of `turns` · 2π for 0 ≤ turns ≤ 1, to 1e-7: by a series, as its twin.
fn sin_cos_turns(turns: f32) -> vec2f {
    let quarters = floor(turns * 4.0 + 0.5);
    let a = (turns * 4.0 - quarters) * (0.5 * PI);
    let a2 = a * a;
    let sin_series = a2 * (1.0 / 120.0 - a2 * (1.0 / 5040.0 - a2 / 362880.0)) - 1.0 / 6.0;
    let s = a + a * a2 * sin_series;
    let cos_series = a2 * (1.0 / 24.0 - a2 * (1.0 / 720.0 - a2 / 40320.0)) - 0.5;
    let c = 1.0 + a2 * cos_series;
    let quadrant = u32(quarters) & 3u;
    let turned = select(vec2f(s, c), vec2f(c, -s), (quadrant & 1u) == 1u);
    return select(turned, -turned, quadrant >= 2u);
}

// A direction around `n` with pdf_sa = cosθ/π.
fn cosine_hemisphere(n: vec3f, u: vec2f) -> vec3f {
    let frame = tangent_frame(n);
    let radius = sqrt(u.x);
    let turn = sin_cos_turns(u.y);
    let height = sqrt(max(1.0 - u.x, 0.0));
    let w = frame.tangent * (radius * turn.y) + frame.bitangent * (radius * turn.x) + n * height;
    return unit(w);
}

// A direction with pdf_sa = 1/4π.
fn uniform_sphere(u: vec2f) -> vec3f {
    let z = 1.0 - 2.0 * u.x;
    let radius = sqrt(max(1.0 - z * z, 0.0));
    let turn = sin_cos_turns(u.y);
    return vec3f(radius * turn.y, radius * turn.x, z);
}

// A direction within acos(`cos_outer`) of `axis` with pdf_sa = 1/(2π(1 − cos_outer)).
fn uniform_cone(axis: vec3f, cos_outer: f32, u: vec2f) -> vec3f {
    let z = 1.0 - u.x * (1.0 - cos_outer);
    let radius = sqrt(max(1.0 - z * z, 0.0));
    let turn = sin_cos_turns(u.y);
    let frame = tangent_frame(axis);
    return frame.tangent * (radius * turn.y) + frame.bitangent * (radius * turn.x) + axis * z;
}

// Barycentrics (of the second and third vertex) with pdf_area = 1/area.
fn uniform_triangle(u: vec2f) -> vec2f {
    let root = sqrt(u.x);
    return vec2f(root * (1.0 - u.y), root * u.y);
}

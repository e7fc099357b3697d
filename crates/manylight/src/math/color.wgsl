// Luminance of linear Rec.709.
fn luminance(color: vec3f) -> f32 {
    return dot(color, vec3f(0.2126, 0.7152, 0.0722));
}

fn max_element(v: vec3f) -> f32 {
    return max(v.x, max(v.y, v.z));
}

// Whether every component is a number; exact even where a compiler may assume that all are.
fn is_finite(v: vec3f) -> bool {
    let bits = bitcast<vec3u>(v) & vec3u(0x7f800000u);
    return all(bits != vec3u(0x7f800000u));
}

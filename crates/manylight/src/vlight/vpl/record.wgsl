// A virtual point light on a Lambertian surface; twin of Vpl.
struct Vpl {
    position: vec3f,
    // Unit, on the side it shines from.
    normal: vec3f,
    // Along the normal, W/sr.
    intensity: vec3f,
}

struct VplInfo {
    count: u32,
    path_count: u32,
    // Lights that the rounds did not reach.
    missing: u32,
    // Rounds that traced paths; 0 for lights on emitters.
    rounds: u32,
}

// max(0, n_x·w) · max(0, −n·w) · min(1/d², 1/d_min²), 1/m²; twin of vpl::geometry.
fn vpl_geometry(p_light: vec3f, n_light: vec3f, p: vec3f, n: vec3f, d_min_sq: f32) -> f32 {
    let offset = p_light - p;
    let dist_sq = dot(offset, offset);
    let cosines = max(dot(n, offset), 0.0) * max(-dot(n_light, offset), 0.0);
    return cosines / max(dist_sq * max(dist_sq, d_min_sq), 1e-30);
}

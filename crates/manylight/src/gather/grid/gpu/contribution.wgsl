// What one grid light gives one receiver; twin of contribution.rs, whose header derives it.

// A grid light as the inner loop reads it; see TileLight in tiles.rs.
struct TileLight {
    position: vec3f,
    nearest_sq: f32,
    normal: vec3f,
    far: f32,
    variance_4: vec3f,
    nearer: f32,
    intensity: vec3f,
    normal_spread_3: f32,
    rise: vec2f,
    fall: vec2f,
    shadow_weight: f32,
}

fn normal_spread(mean: vec3f) -> f32 {
    return max(1.0 - dot(mean, mean), 0.0) * 0.5;
}

fn reach_behind(normal: vec3f, spread: f32, variance: vec3f) -> vec2f {
    let s = dot(normal * normal, variance);
    return vec2f((REACH_PULL + REACH_SPREAD) * s, REACH_SPREAD * spread);
}

fn reach_below(variance: vec3f) -> f32 {
    return (REACH_PULL + REACH_SPREAD) * max(variance.x, max(variance.y, variance.z));
}

struct SoftClamp {
    above: f32,
    below: f32,
    open: f32,
}

// Mean of max(0, a + t) for t uniform with a variance, as a fraction.
fn soft_clamp(a: f32, variance_3: f32) -> SoftClamp {
    let half_width = sqrt(variance_3);
    let width = half_width + half_width;
    let below = max(width + width, NO_SPREAD);
    let t = min(max(a + half_width, 0.0), width);
    let rest = max(a - half_width, 0.0);
    return SoftClamp(t * t + below * rest, below, t + t);
}

// Mean of cos x · cos l / d² over the lights of a grid light, 1/m², before blending.
fn geometry(light: TileLight, offset: vec3f, n: vec3f, d_min_sq: f32) -> f32 {
    let m = light.normal;
    let v4 = light.variance_4;
    let dist_sq = max(dot(offset, offset), light.nearest_sq);
    let inverse_sq = 1.0 / dist_sq;

    // r = 1/(1 + 4v/d²) per axis, with one division.
    let a = v4 * inverse_sq + 1.0;
    let a_yz = a.y * a.z;
    let product = 1.0 / (a.x * a_yz);
    let x_product = a.x * product;
    let r = vec3f(a_yz * product, a.z * x_product, a.y * x_product);

    let p = offset * r;
    let s4 = v4 * r;
    let ms4 = m * s4;
    let cos_x = soft_clamp(dot(n, p), 0.75 * dot(n, n * s4));
    let cos_l = soft_clamp(-dot(m, p), light.normal_spread_3 * dist_sq + 0.75 * dot(m, ms4));
    let joint = 0.25 * dot(n, ms4);
    let cosines = max(cos_x.above * cos_l.above - joint * (cos_x.open * cos_l.open), 0.0);

    let far = light.far * inverse_sq + 1.0;
    let far_sq = far * far;
    let along = 3.0 * dot(v4 * offset, offset) * inverse_sq;
    let mean = along * inverse_sq + far_sq;
    let clamped = max(far, d_min_sq * inverse_sq);
    let below = cos_x.below * cos_l.below * far_sq * (far * clamped);
    return (cosines * inverse_sq) * (mean * inverse_sq) / below;
}

// Share of a light that its level gives at an offset from the receiver.
fn blend(nearer: f32, rise: vec2f, fall: vec2f, offset: vec3f) -> f32 {
    let dist = sqrt(max(dot(offset, offset) - nearer, 0.0));
    return max(min(min(dist * rise.x + rise.y, dist * fall.x + fall.y), 1.0), 0.0);
}

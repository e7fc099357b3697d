// Taps of the kernel: what surfaces say about their weights, and sums over two signals at once.

// The plane of a receiver, and what else tells others apart from it; twin of Pass::begin.
struct Plane {
    // Unit geometric normal over the plane slack, and its product with the position.
    scaled: vec3f,
    offset: f32,
    // Unit geometric normal, zero where there is no surface; luminance of the albedo.
    normal: vec3f,
    albedo: f32,
}

fn plane_of(guide_position: vec4f, guide_normal: vec4f, inverse_step: f32) -> Plane {
    let scaled = guide_normal.xyz * (guide_position.w * inverse_step);
    return Plane(scaled, dot(scaled, guide_position.xyz), guide_normal.xyz, guide_normal.w);
}

// Kernel · normals, and 1 + the squared distances of planes and albedos; twin of Tap::weigh.
fn weigh(here: Plane, guide_position: vec4f, guide_normal: vec4f, kernel: f32) -> vec2f {
    let cos_theta = max(dot(here.normal, guide_normal.xyz), 0.0);
    let cos_sq = cos_theta * cos_theta;
    let plane = dot(here.scaled, guide_position.xyz) - here.offset;
    let albedo = here.albedo - guide_normal.w;
    return vec2f(
        kernel * (cos_sq * cos_sq),
        1.0 + plane * plane + albedo * albedo * ALBEDO_SCALE,
    );
}

// Weight of one of the 3 × 3 taps, which are counted row by row.
fn tap_kernel(tap: u32) -> f32 {
    let x = select(KERNEL_SIDE, KERNEL_CENTER, tap % 3u == 1u);
    return x * select(KERNEL_SIDE, KERNEL_CENTER, tap / 3u == 1u);
}

// Position of a tap, negative outside the picture.
fn tap_index(pixel: vec2u, tap: u32, step: u32, size: vec2u) -> i32 {
    let at = vec2i(pixel) + (vec2i(i32(tap % 3u), i32(tap / 3u)) - 1) * i32(step);
    if any(at < vec2i(0)) || any(at >= vec2i(size)) {
        return -1;
    }
    return at.y * i32(size.x) + at.x;
}

// Weighted sums of two signals.
struct Sums {
    value: vec2f,
    variance: vec2f,
    total: vec2f,
}

fn add_tap(sums: ptr<function, Sums>, weight: vec2f, value: vec2f, variance: vec2f) {
    (*sums).value += weight * value;
    (*sums).variance += weight * weight * variance;
    (*sums).total += weight;
}

// Mean and variance of each signal in turn, the old ones where nothing was summed up; twin of
// Pass::end.
fn means(sums: Sums, old: vec4f) -> vec4f {
    let found = sums.total > vec2f(0.0);
    let total = select(vec2f(1.0), sums.total, found);
    let value = select(old.xz, sums.value / total, found);
    let variance = select(old.yw, sums.variance / (total * total), found);
    return vec4f(value.x, variance.x, value.y, variance.y);
}

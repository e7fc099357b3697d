// Sums over the shares around one vertex; lengths in cells, positions relative to the vertex. Twin
// of Moments in sweep.rs.
import package::gather::grid::gpu::record;

struct Moments {
    // Σ intensity and Σ luminance.
    light: vec4f,
    // Σ luminance · offset and offset².
    offset: vec3f,
    offset_sq: vec3f,
    // Σ luminance · normal.
    normal: vec3f,
}

fn add_share(m: ptr<function, Moments>, light: vec4f, normal: vec3f, share: f32, mean: vec3f,
    variance: vec3f) {
    let mass = light.w * share;
    (*m).light += light * share;
    (*m).offset += mean * mass;
    (*m).offset_sq += (variance + mean * mean) * mass;
    (*m).normal += normal * mass;
}

fn join(a: Moments, b: Moments) -> Moments {
    return Moments(a.light + b.light, a.offset + b.offset, a.offset_sq + b.offset_sq,
        a.normal + b.normal);
}

fn vertex_of(light: GridLight) -> vec3u {
    let xy = light.vertex_xy;
    return vec3u(xy & 0xffffu, xy >> 16u, light.vertex_z_lobe & 0xffffu);
}

// A grid light from the sums around its vertex; keeps the vertex.
fn light_of(m: Moments, known: GridLight, origin: vec3f, size: f32) -> GridLight {
    var light = known;
    let mass = m.light.w;
    let p_vertex = origin + vec3f(vertex_of(known)) * size;
    light.position = p_vertex;
    light.luminance = 0.0;
    light.intensity = vec3f(0.0);
    light.normal = vec3f(0.0);
    light.variance = vec3f(0.0);
    if mass > 0.0 {
        let mean = m.offset / mass;
        light.position = p_vertex + mean * size;
        light.luminance = mass;
        light.intensity = m.light.xyz;
        light.normal = m.normal / mass;
        light.variance = max(m.offset_sq / mass - mean * mean, vec3f(0.0)) * (size * size);
    }
    return light;
}

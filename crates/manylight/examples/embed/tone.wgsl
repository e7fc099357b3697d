// From light to the screen, by this program's own taste.

@group(0) @binding(0) var light: texture_2d<f32>;
@group(0) @binding(1) var<uniform> exposure: f32;

// One triangle over the whole screen.
@vertex
fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    let at = vec2f(vec2u((index << 1u) & 2u, index & 2u));
    return vec4f(at * 2.0 - 1.0, 0.0, 1.0);
}

@fragment
fn tone(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let color = textureLoad(light, vec2i(at.xy), 0).rgb * exposure;
    return vec4f(1.0 - exp(-max(color, vec3f(0.0))), 1.0);
}

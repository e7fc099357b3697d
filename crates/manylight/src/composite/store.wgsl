// A plane into a texture of half floats.

struct StoreParams {
    width: u32,
    height: u32,
}

@group(0) @binding(0) var<uniform> params: StoreParams;
@group(0) @binding(1) var<storage, read> colors: array<vec4f>;
@group(0) @binding(2) var<storage, read> fourths: array<vec4f>;
@group(0) @binding(3) var texels: texture_storage_2d<rgba16float, write>;

// Largest half float.
const MOST = 65504.0;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let pixel = id.y * params.width + id.x;
    let value = vec4f(colors[pixel].rgb, fourths[pixel].w);
    textureStore(texels, vec2i(id.xy), clamp(value, vec4f(-MOST), vec4f(MOST)));
}

// What the scene binds in one way on every device: its uniform, and textures as layers of one array.

@group(1) @binding(0) var<uniform> scene: SceneInfo;
@group(1) @binding(5) var textures: texture_2d_array<u32>;

// A texel of a page.
fn load_texel(page: u32, at: vec2u) -> vec4u {
    return textureLoad(textures, at, page, 0);
}

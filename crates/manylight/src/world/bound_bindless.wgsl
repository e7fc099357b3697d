// What the scene binds where textures are bound one by one: no uniform may be beside them.
enable wgpu_binding_array;

@group(1) @binding(0) var<storage, read> scene: SceneInfo;
@group(1) @binding(5) var textures: binding_array<texture_2d<u32>>;

// A texel of a texture; neighbors may read different ones.
fn load_texel(page: u32, at: vec2u) -> vec4u {
    return textureLoad(textures[page], at, 0);
}

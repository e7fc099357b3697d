// What the scene binds where textures are bound one by one: no uniform may be beside them.
enable wgpu_binding_array;

@group(1) @binding(0) var<storage, read> scene: SceneInfo;
@group(1) @binding(5) var textures: binding_array<texture_2d<u32>>;

// The first texel of a texture, or all four. Neighbors may read different textures: a driver that
// goes through them one by one takes long to compile each fetch, so there is one.
fn load_texels(page: u32, places: array<vec2u, 4>, count: u32) -> array<vec4u, 4> {
    var at = places;
    var texels: array<vec4u, 4>;
    for (var i = 0u; i < min(count, 4u); i++) {
        texels[i] = textureLoad(textures[page], at[i], 0);
    }
    return texels;
}

// What the scene binds on every device: its uniform, and textures as layers of one array.

@group(1) @binding(0) var<uniform> scene: SceneInfo;
@group(1) @binding(5) var textures: texture_2d_array<u32>;

// The first texel of a page, or all four.
fn load_texels(page: u32, places: array<vec2u, 4>, count: u32) -> array<vec4u, 4> {
    if count == 1u {
        let one = textureLoad(textures, places[0], page, 0);
        return array<vec4u, 4>(one, one, one, one);
    }
    return array<vec4u, 4>(
        textureLoad(textures, places[0], page, 0),
        textureLoad(textures, places[1], page, 0),
        textureLoad(textures, places[2], page, 0),
        textureLoad(textures, places[3], page, 0),
    );
}

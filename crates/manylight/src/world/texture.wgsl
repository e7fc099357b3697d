// Reading textures: wrapping, filtering, decoding; twin of texture.rs.
import package::world::scene;

// Words of a slot: image (page, x, y, width, height), wraps of u and v, linear filter, set of
// coordinates, and the 2 × 3 map of coordinates (columns).

// A code value of sRGB → linear.
fn srgb_to_linear(code: vec3f) -> vec3f {
    let c = code / 255.0;
    return select(pow((c + 0.055) / 1.055, vec3f(2.4)), c / 12.92, c <= vec3f(0.04045));
}

// A coordinate in texels, 0…size; 0…2 · size for mirrored ones.
fn scale_inside(coordinate: f32, wrap: u32, size: u32) -> f32 {
    var inside = clamp(coordinate, 0.0, 1.0);
    if wrap == WRAP_REPEAT {
        inside = coordinate - floor(coordinate);
    } else if wrap == WRAP_MIRROR {
        inside = coordinate - floor(coordinate * 0.5) * 2.0;
    }
    return inside * f32(size);
}

fn wrap_around(index: i32, period: i32) -> i32 {
    return select(select(index, index - period, index >= period), index + period, index < 0);
}

// The texel at an index that is at most one outside of 0…size, or 0…2 · size if mirrored.
fn wrap_texel(index: i32, wrap: u32, size: u32) -> u32 {
    let n = i32(size);
    var wrapped = clamp(index, 0, n - 1);
    if wrap == WRAP_REPEAT {
        wrapped = wrap_around(index, n);
    } else if wrap == WRAP_MIRROR {
        let i = wrap_around(index, 2 * n);
        wrapped = select(2 * n - 1 - i, i, i < n);
    }
    return u32(clamp(wrapped, 0, n - 1));
}

fn decode(texel: vec4u, srgb: bool) -> vec4f {
    let code = vec4f(texel);
    if srgb {
        return vec4f(srgb_to_linear(code.rgb), code.a / 255.0);
    }
    return code / 255.0;
}

// Where the texel at an index lies on its page.
fn texel_place(slot: u32, x: i32, y: i32) -> vec2u {
    let column = wrap_texel(x, geometry[slot + 5u], geometry[slot + 3u]);
    let row = wrap_texel(y, geometry[slot + 6u], geometry[slot + 4u]);
    return vec2u(geometry[slot + 1u] + column, geometry[slot + 2u] + row);
}

// A slot's value at texture coordinates in 0…1, colors decoded before they are filtered.
fn sample_slot(index: u32, coordinates: vec2f, srgb: bool) -> vec4f {
    let slot = scene.slots + index * SLOT_WORDS;
    var uv = geometry_vec2(slot + 9u) * coordinates.x + geometry_vec2(slot + 11u) * coordinates.y
        + geometry_vec2(slot + 13u);
    let bits = bitcast<vec2u>(uv) & vec2u(0x7f800000u);
    if any(bits == vec2u(0x7f800000u)) {
        uv = vec2f(0.0);
    }
    let x = scale_inside(uv.x, geometry[slot + 5u], geometry[slot + 3u]);
    let y = scale_inside(uv.y, geometry[slot + 6u], geometry[slot + 4u]);
    let is_linear = geometry[slot + 7u] != 0u;
    let corner = floor(vec2f(x, y) - select(0.0, 0.5, is_linear));
    let i = vec2i(corner);
    let places = array<vec2u, 4>(
        texel_place(slot, i.x, i.y),
        texel_place(slot, i.x + 1, i.y),
        texel_place(slot, i.x, i.y + 1),
        texel_place(slot, i.x + 1, i.y + 1),
    );
    let texels = load_texels(geometry[slot], places, select(1u, 4u, is_linear));
    let a = decode(texels[0], srgb);
    if !is_linear {
        return a;
    }
    let f = vec2f(x, y) - 0.5 - corner;
    let b = decode(texels[1], srgb);
    let c = decode(texels[2], srgb);
    let d = decode(texels[3], srgb);
    let upper = a + (b - a) * f.x;
    let lower = c + (d - c) * f.x;
    return upper + (lower - upper) * f.y;
}

// Texture coordinates of a point; zero where the mesh has none.
fn uv_at(mesh: u32, index: u32, vertices: vec3u, at: vec2f) -> vec2f {
    let uv_set = geometry[scene.slots + index * SLOT_WORDS + 8u];
    let list = geometry[mesh + 5u + min(uv_set, 1u)];
    if list == NONE {
        return vec2f(0.0);
    }
    let a = geometry_vec2(list + 2u * vertices.x);
    let b = geometry_vec2(list + 2u * vertices.y);
    let c = geometry_vec2(list + 2u * vertices.z);
    return a + (b - a) * at.x + (c - a) * at.y;
}

// Color of a point's vertices.
fn vertex_color(mesh: u32, vertices: vec3u, at: vec2f) -> vec4f {
    let list = geometry[mesh + 7u];
    if list == NONE {
        return vec4f(1.0);
    }
    let a = geometry_vec4(list + 4u * vertices.x);
    let b = geometry_vec4(list + 4u * vertices.y);
    let c = geometry_vec4(list + 4u * vertices.z);
    return a + (b - a) * at.x + (c - a) * at.y;
}

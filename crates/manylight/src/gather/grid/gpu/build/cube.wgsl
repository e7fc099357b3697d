// The cube around all lights and its cells; twin of Cube in build.rs.

struct Cube {
    origin: vec3f,
    edge: f32,
}

fn cube_around(low: vec3f, high: vec3f) -> Cube {
    // A little room, so that the last light lies inside the last cell.
    let size = high - low;
    let most = max(abs(high.x), max(abs(high.y), abs(high.z)));
    let edge = max(max(size.x, max(size.y, size.z)) * 1.0001, 1e-4 * max(most, 1e-3));
    return Cube(low, edge);
}

// Position in cells of level 1 where there are `level_count` levels.
fn lattice_position(cube: Cube, level_count: u32, p: vec3f) -> vec3f {
    let size = cube.edge / f32(1u << (level_count - 1u));
    return max((p - cube.origin) * (1.0 / size), vec3f(0.0));
}

// Level-1 cell of a position.
fn cell_of(cube: Cube, level_count: u32, p: vec3f) -> vec3u {
    let last = (1u << (level_count - 1u)) - 1u;
    return min(vec3u(lattice_position(cube, level_count, p)), vec3u(last));
}

// 0…5 for +x −x +y −y +z −z.
fn dominant_axis(normal: vec3f) -> u32 {
    let a = abs(normal);
    var axis = 2u;
    if a.x >= a.y && a.x >= a.z {
        axis = 0u;
    } else if a.y >= a.z {
        axis = 1u;
    }
    return 2u * axis + select(0u, 1u, normal[axis] < 0.0);
}

fn lobe_of(normal: vec3f, lobes: u32) -> u32 {
    return select(dominant_axis(normal), 0u, lobes == 1u);
}

// Puts two zero bits between the lowest ten bits.
fn spread_3d(word: u32) -> u32 {
    var x = word & 0x3ffu;
    x = (x | (x << 16u)) & 0x030000ffu;
    x = (x | (x << 8u)) & 0x0300f00fu;
    x = (x | (x << 4u)) & 0x030c30c3u;
    return (x | (x << 2u)) & 0x09249249u;
}

fn interleave(cell: vec3u) -> u32 {
    return spread_3d(cell.x) | (spread_3d(cell.y) << 1u) | (spread_3d(cell.z) << 2u);
}

// Interleaved bits of a cell's coordinates, low word first.
fn morton(cell: vec3u) -> vec2u {
    let low = interleave(cell);
    let high = interleave(cell >> vec3u(10u));
    return vec2u(low | (high << 30u), high >> 2u);
}

fn shift_right(key: vec2u, bits: u32) -> vec2u {
    if bits == 0u {
        return key;
    }
    if bits >= 32u {
        return vec2u(key.y >> (bits - 32u), 0u);
    }
    return vec2u((key.x >> bits) | (key.y << (32u - bits)), key.y >> bits);
}

// Takes every third bit of the lowest thirty.
fn gather_3d(word: u32) -> u32 {
    var x = word & 0x09249249u;
    x = (x | (x >> 2u)) & 0x030c30c3u;
    x = (x | (x >> 4u)) & 0x0300f00fu;
    x = (x | (x >> 8u)) & 0x030000ffu;
    return (x | (x >> 16u)) & 0x3ffu;
}

// Coordinates of a cell from a key `depth` halvings deep.
fn position_of(key: vec2u, depth: u32) -> vec3u {
    let low = key.x & 0x3fffffffu;
    let high = shift_right(key, 30u).x;
    let cell = vec3u(
        gather_3d(low) | (gather_3d(high) << 10u),
        gather_3d(low >> 1u) | (gather_3d(high >> 1u) << 10u),
        gather_3d(low >> 2u) | (gather_3d(high >> 2u) << 10u),
    );
    return cell & vec3u((1u << depth) - 1u);
}

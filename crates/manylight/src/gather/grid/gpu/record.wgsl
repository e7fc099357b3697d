// Records of the hierarchy; described in record.rs.

struct LevelInfo {
    first_cell: u32,
    cell_count: u32,
    first_light: u32,
    light_count: u32,
}

struct GridInfo {
    origin: vec3f,
    edge: f32,
    level_count: u32,
    vpl_count: u32,
    light_count: u32,
    cell_count: u32,
    levels: array<LevelInfo, LEVEL_ENTRIES>,
}

struct GridLight {
    position: vec3f,
    luminance: f32,
    intensity: vec3f,
    vertex_xy: u32,
    normal: vec3f,
    vertex_z_lobe: u32,
    variance: vec3f,
}

struct Octants {
    luminance: array<f32, 8>,
    cells: array<u32, 8>,
}

struct Cell {
    share: array<f32, 8>,
    inner: u32,
    light: u32,
    octant_owned: u32,
    first_owned: u32,
    cell_xy: u32,
    cell_z_lobe: u32,
    _pad: vec2u,
}

// Size of a level's cells, m; level 0 has those of level 1.
fn cell_size(info: GridInfo, level: u32) -> f32 {
    return info.edge / f32(1u << (info.level_count - max(level, 1u)));
}

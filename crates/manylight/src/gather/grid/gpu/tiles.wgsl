// Which lights can give something to some receivers; twin of tiles.rs.
//
// Reads: `info`, `reach`, `params`, `lights`, `vpls`.
import package::gather::grid::gpu::record;
import package::gather::grid::gpu::reach;
import package::gather::grid::gpu::contribution;
import package::vlight::vpl::record;
import package::math::color;

// Bounds of some receivers; none where low lies above high.
struct Bounds {
    low: vec3f,
    high: vec3f,
    normal_low: vec3f,
    normal_high: vec3f,
}

// Distances that bound one level's shell, squared, and its blending.
struct Shell {
    inner_sq: f32,
    outer_sq: f32,
    rise: vec2f,
    fall: vec2f,
}

// Square of an outer radius beyond all receivers.
const ENDLESS_SQ = 3e38;
const ALWAYS = vec2f(0.0, 1.0);

var<workgroup> shells: array<Shell, LEVEL_ENTRIES>;

// Blending of all levels; a barrier must follow.
fn fill_shells(local: u32) {
    if local >= LEVEL_ENTRIES {
        return;
    }
    let start = select(1u, 0u, info.levels[0].light_count > 0u);
    let is_start = local == start;
    let is_top = local >= info.level_count;
    let r = reach.alpha * cell_size(info, min(local, info.level_count))
        * select(1.0, 0.5, local == 0u);
    let outer = 2.0 * r;
    shells[local] = Shell(
        select(r * r * 0.25, 0.0, is_start),
        select(outer * outer, ENDLESS_SQ, is_top),
        select(vec2f(2.0 / r, -1.0), ALWAYS, is_start),
        select(vec2f(-1.0 / r, 2.0), ALWAYS, is_top),
    );
}

// A light by its level and index, a virtual light itself in level 0, with the spread that the
// settings grant it.
fn load_light(level: u32, index: u32) -> GridLight {
    if level == 0u {
        let vpl = vpls[index];
        let nothing = vec3f(0.0);
        let y = luminance(vpl.intensity);
        return GridLight(vpl.position, y, vpl.intensity, 0u, vpl.normal, 0u, nothing);
    }
    var light = lights[index];
    if !has_flag(SPREAD) {
        let length_sq = dot(light.normal, light.normal);
        light.normal = select(vec3f(0.0), light.normal / sqrt(length_sq), length_sq > 0.0);
        light.variance = vec3f(0.0);
    }
    return light;
}

// A unit normal's length is one within rounding, and must not pass for a spread.
fn spread_of_normals(light: GridLight, level: u32) -> f32 {
    let is_point = level == 0u || !has_flag(SPREAD);
    return select(normal_spread(light.normal), 0.0, is_point);
}

// Which receivers see a light; twin of class_of in interleave.rs.
fn class_of(light: GridLight, level: u32) -> u32 {
    if level < FIRST_LEVEL {
        return EVERY;
    }
    let x = light.vertex_xy & 0xffffu;
    let y = light.vertex_xy >> 16u;
    let z = light.vertex_z_lobe & 0xffffu;
    let lobe = light.vertex_z_lobe >> 16u;
    let side = params.side;
    return (x + side * y + (2u * side - 1u) * z + (2u * side + 1u) * lobe) % (side * side);
}

fn is_of_class(light: GridLight, level: u32, wanted: u32) -> bool {
    let own = class_of(light, level);
    return own == wanted || own == EVERY;
}

fn tile_light(light: GridLight, level: u32) -> TileLight {
    let scale = select(1.0, f32(params.side * params.side), level >= FIRST_LEVEL);
    let shell = shells[level];
    let total_variance = light.variance.x + light.variance.y + light.variance.z;
    let is_drawn = level >= params.shadow_start_level || level == info.level_count;
    return TileLight(
        light.position,
        NEAREST_SHARE * total_variance + NEAREST_SQ,
        light.normal,
        FAR * total_variance,
        4.0 * light.variance,
        NEARER * total_variance,
        scale * light.intensity,
        3.0 * spread_of_normals(light, level),
        shell.rise,
        shell.fall,
        select(0.0, scale * light.luminance, is_drawn),
    );
}

// Whether the shell around a light meets the bounds, any of them lies on its lit side, and it on
// the side that any of them faces.
fn is_in_reach(light: GridLight, level: u32, bounds: Bounds) -> bool {
    let low = bounds.low - light.position;
    let high = bounds.high - light.position;
    let nearest = clamp(vec3f(0.0), low, high);
    let farthest = max(abs(low), abs(high));
    let farthest_sq = dot(farthest, farthest);
    let nearer = NEARER * (light.variance.x + light.variance.y + light.variance.z);
    let shell = shells[level];
    let is_beyond = dot(nearest, nearest) >= shell.outer_sq + nearer;
    // The first level gives at any distance, zero included.
    let is_inside = shell.inner_sq > 0.0 && farthest_sq <= shell.inner_sq + nearer;
    if is_beyond || is_inside {
        return false;
    }
    // Largest m·(x − p) over the box, against how far the spread reaches behind.
    let in_front = max(light.normal * low, light.normal * high);
    let front = in_front.x + in_front.y + in_front.z;
    let behind = reach_behind(
        light.normal, spread_of_normals(light, level), light.variance);
    if front <= 0.0 && front * front >= behind.x + behind.y * farthest_sq {
        return false;
    }
    // The same for n·(p − x), n anywhere in the bounds of the normals.
    let n0 = bounds.normal_low;
    let n1 = bounds.normal_high;
    let faced = max(max(n0 * -low, n0 * -high), max(n1 * -low, n1 * -high));
    let facing = faced.x + faced.y + faced.z;
    return facing > 0.0 || facing * facing < reach_below(light.variance);
}

// Light from infinity; twin of sky.rs.

import package::emitter::sources;
import package::math::color;
import package::math::warp;

struct SkySample {
    // Unit, toward the sky.
    direction: vec3f,
    radiance: vec3f,
    pdf_sa: f32,
}

fn has_sky() -> bool {
    return sources[SOURCE_SKY_KIND] != 0u;
}

fn sky_is_map() -> bool {
    return sources[SOURCE_SKY_KIND] == SKY_MAP;
}

// Bits of a texel's radiance, and its threshold among all of them, row by row.
fn sky_texel(index: u32) -> vec4u {
    let width = max(sources[SOURCE_SKY_WIDTH], 1u);
    return textureLoad(sky_texels, vec2u(index % width, index / width), 0);
}

fn sky_texel_radiance(index: u32) -> vec3f {
    return bitcast<vec3f>(sky_texel(index).rgb);
}

// Draws a texel: the row by the last threshold of each, then the column; twin of Discrete::sample.
fn draw_sky_texel(u: f32) -> u32 {
    let width = sources[SOURCE_SKY_WIDTH];
    let height = sources[SOURCE_SKY_HEIGHT];
    let row = min(draw_source(sources[SOURCE_SKY_ROWS_BY_FLUX], height, u), height - 1u);
    let draw = draw_of(u);
    var low = 0u;
    var high = width;
    // At most 32 halvings.
    for (var i = 0u; i < 32u && low < high; i++) {
        let middle = low + (high - low) / 2u;
        if textureLoad(sky_texels, vec2u(middle, row), 0).a <= draw {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return row * width + min(low, width - 1u);
}

// Cosine at a row's upper edge.
fn sky_row_cos(row: u32) -> f32 {
    return source_f32(sources[SOURCE_SKY_ROWS] + row);
}

// Density of a texel's directions: its share of the flux over its solid angle is its luminance
// over the total.
fn sky_density(radiance: vec3f) -> f32 {
    return max(luminance(radiance), 0.0) * source_f32(SOURCE_SKY_INVERSE_TOTAL);
}

// Radiance from a direction; black without a sky; twin of SkyEmitter::radiance.
fn sky_radiance(toward_sky: vec3f) -> vec3f {
    let kind = sources[SOURCE_SKY_KIND];
    if kind == SKY_MAP {
        return sky_texel_radiance(sky_texel_of(toward_sky));
    }
    if kind == SKY_CONSTANT {
        return source_vec3(sources[SOURCE_SKY_RADIANCE]);
    }
    return vec3f(0.0);
}

// A direction, its radiance and its density; twin of SkyEmitter::sample.
fn sky_sample(u: vec2f) -> SkySample {
    if !sky_is_map() {
        return SkySample(uniform_sphere(u), sky_radiance(vec3f(0.0)), 0.25 / PI);
    }
    let width = sources[SOURCE_SKY_WIDTH];
    let index = draw_sky_texel(u.x);
    let texel = sky_texel(index);
    // What the search left of u.x places the direction inside the texel.
    var below = 0u;
    if index > 0u {
        below = sky_texel(index - 1u).a;
    }
    let step = max(texel.a - below, 1u);
    let left = clamp(f32(draw_of(u.x) - below) / f32(step), 0.0, 1.0);
    let direction = sky_direction_of(f32(index % width) + left, index / width, u.y);
    let radiance = bitcast<vec3f>(texel.rgb);
    return SkySample(direction, radiance, sky_density(radiance));
}

// Density of sky_sample at a direction; twin of SkyEmitter::pdf_sa.
fn sky_pdf_sa(toward_sky: vec3f) -> f32 {
    if !sky_is_map() {
        return 0.25 / PI;
    }
    return sky_density(sky_texel_radiance(sky_texel_of(toward_sky)));
}

// The direction of a column coordinate and a share 0…1 of a row's solid angle.
fn sky_direction_of(column: f32, row: u32, share: f32) -> vec3f {
    let top = sky_row_cos(row);
    let cos_theta = top + (sky_row_cos(row + 1u) - top) * share;
    let sin_theta = sqrt(max(1.0 - cos_theta * cos_theta, 0.0));
    let turns = column / f32(sources[SOURCE_SKY_WIDTH]) - source_f32(SOURCE_SKY_TURN);
    let sin_cos = sin_cos_turns(turns - floor(turns));
    return vec3f(-sin_theta * sin_cos.y, cos_theta, -sin_theta * sin_cos.x);
}

// The texel of a direction.
fn sky_texel_of(direction: vec3f) -> u32 {
    let width = sources[SOURCE_SKY_WIDTH];
    let height = sources[SOURCE_SKY_HEIGHT];
    let turns = atan2(-direction.z, -direction.x) / (2.0 * PI) + source_f32(SOURCE_SKY_TURN);
    let column = min(u32((turns - floor(turns)) * f32(width)), width - 1u);
    let cos_theta = clamp(direction.y, -1.0, 1.0);
    var row = min(u32(acos(cos_theta) / PI * f32(height)), height - 1u);
    // The arc cosine of a device is off by more than the table of cosines.
    for (var i = 0u; i < 4u; i++) {
        if row > 0u && cos_theta > sky_row_cos(row) {
            row -= 1u;
        } else if row + 1u < height && cos_theta <= sky_row_cos(row + 1u) {
            row += 1u;
        }
    }
    return row * width + column;
}

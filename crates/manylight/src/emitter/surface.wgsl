// Emissive triangles as one source; twin of surface.rs.

import package::emitter::sources;
import package::math::warp;
import package::surface::point;
import package::world::rays;

struct SurfaceSample {
    position: vec3f,
    // Whether there is any.
    found: bool,
    // Unit, of the front side.
    normal: vec3f,
    // Over the area of all emissive triangles, 1/m².
    pdf_area: f32,
    // On the emitting sides.
    radiance: vec3f,
    double_sided: bool,
}

fn has_surface_emitter() -> bool {
    return sources[SOURCE_TRIANGLE_COUNT] > 0u;
}

// Draws a point in proportion to flux; twin of SurfaceEmitter::sample.
fn surface_sample(choose: f32, u: vec2f) -> SurfaceSample {
    let count = sources[SOURCE_TRIANGLE_COUNT];
    let table = sources[SOURCE_TRIANGLES_BY_FLUX];
    let index = draw_source(table, count, choose);
    if index >= count {
        return SurfaceSample(vec3f(0.0), false, vec3f(0.0), 0.0, vec3f(0.0), false);
    }
    let record = sources[SOURCE_TRIANGLES] + TRIANGLE_WORDS * index;
    let instance = sources[record];
    let triangle = sources[record + 1u];
    let area = source_f32(record + 2u);
    let uv = uniform_triangle(u);
    var corners = triangle_corners(instance, triangle);
    let position =
        corners[0] + (corners[1] - corners[0]) * uv.x + (corners[2] - corners[0]) * uv.y;
    // Texels that are cut out do not shine.
    let present = presence_at(instance, triangle, uv);
    return SurfaceSample(
        position,
        true,
        front_normal(instance, triangle),
        source_pmf(table, count, index) / area,
        emission_at(instance, triangle, uv) * present,
        sources[record + 3u] != 0u,
    );
}

// Density with which surface_sample finds a point of a triangle; 0 where it never does; twin of
// SurfaceEmitter::pdf_area.
fn surface_pdf_area(instance: u32, triangle: u32) -> f32 {
    if instance >= sources[SOURCE_INSTANCE_COUNT] {
        return 0.0;
    }
    let first = sources[sources[SOURCE_FIRST_OF_INSTANCE] + instance];
    let count = sources[SOURCE_TRIANGLE_COUNT];
    if first == NO_TRIANGLE || first + triangle >= count {
        return 0.0;
    }
    let index = first + triangle;
    let area = source_f32(sources[SOURCE_TRIANGLES] + TRIANGLE_WORDS * index + 2u);
    if area > 0.0 {
        return source_pmf(sources[SOURCE_TRIANGLES_BY_FLUX], count, index) / area;
    }
    return 0.0;
}

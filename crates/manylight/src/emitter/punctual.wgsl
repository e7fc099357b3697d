// Sun, point and spot lights; twin of the lights of mod.rs.

import package::emitter::sources;
import package::math::color;
import package::math::warp;

struct PunctualLight {
    kind: u32,
    position: vec3f,
    // Unit, the way the light travels.
    direction: vec3f,
    // W/sr; of a sun W/m² on a surface facing it.
    intensity: vec3f,
    cos_outer: f32,
    cos_inner: f32,
}

fn punctual_light(index: u32) -> PunctualLight {
    let at = sources[SOURCE_LIGHTS] + LIGHT_WORDS * index;
    return PunctualLight(
        sources[at],
        source_vec3(at + 1u),
        source_vec3(at + 4u),
        source_vec3(at + 7u),
        source_f32(at + 10u),
        source_f32(at + 11u),
    );
}

// Share of a spot's intensity at an angle from its axis.
fn spot_fade(cos_theta: f32, cos_outer: f32, cos_inner: f32) -> f32 {
    let ramp = clamp((cos_theta - cos_outer) / max(cos_inner - cos_outer, 1e-6), 0.0, 1.0);
    return ramp * ramp;
}

// What a light without a surface gives a point; twin of Emitters::direct.

import package::bvh::traverse;
import package::emitter::punctual;

struct DirectSample {
    // Unit, toward the source.
    direction: vec3f,
    // To the source, m; FAR_AWAY for a sun.
    distance: f32,
    // On a surface facing the source, W/m².
    irradiance: vec3f,
    // Whether it gives anything.
    found: bool,
}

fn direct_sample(index: u32, p: vec3f) -> DirectSample {
    let light = punctual_light(index);
    if light.kind == KIND_SUN {
        return DirectSample(-light.direction, FAR_AWAY, light.intensity, true);
    }
    let distance = length(light.position - p);
    let direction = normalize_or_zero(light.position - p);
    var intensity = light.intensity;
    if light.kind != KIND_POINT {
        intensity *= spot_fade(-dot(direction, light.direction), light.cos_outer, light.cos_inner);
    }
    let irradiance = intensity / (distance * distance);
    let found = any(direction != vec3f(0.0))
        && is_finite(irradiance)
        && any(irradiance != vec3f(0.0));
    return DirectSample(direction, distance, irradiance, found);
}

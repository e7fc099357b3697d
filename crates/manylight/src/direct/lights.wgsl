// Irradiance from sun, point and spot lights; twin of from_lights in mod.rs.

import package::emitter::direct_sample;
import package::math::color;
import package::math::sequence;
import package::shadow::shadow;

// What a light gives a receiver without visibility, its cosine included.
fn unshadowed_light(index: u32, s: SurfacePoint) -> DirectSample {
    var light = direct_sample(index, s.position);
    light.irradiance *= max(dot(s.ns, light.direction), 0.0);
    light.found = light.found && max_element(light.irradiance) > 0.0;
    return light;
}

fn is_light_seen(s: SurfacePoint, light: DirectSample) -> bool {
    return light.found && is_open(s, light.direction, light.distance);
}

// With visibility, W/m²; exact for few lights, else by independent draws in proportion to the
// unshadowed luminance.
fn from_lights(s: SurfacePoint, sequence: ptr<function, Sequence>) -> vec3f {
    let count = sources[SOURCE_LIGHT_COUNT];
    var sum = vec3f(0.0);
    if count <= EXACT_LIGHTS {
        for (var i = 0u; i < count; i++) {
            let light = unshadowed_light(i, s);
            if is_light_seen(s, light) {
                sum += light.irradiance;
            }
        }
        return sum;
    }
    var total = 0.0;
    for (var i = 0u; i < count; i++) {
        let light = unshadowed_light(i, s);
        total += select(0.0, luminance(light.irradiance), light.found);
    }
    // All draws in one further look at the lights.
    var left: array<f32, EXACT_LIGHTS>;
    var drawn: array<u32, EXACT_LIGHTS>;
    for (var k = 0u; k < EXACT_LIGHTS; k++) {
        left[k] = next_1d(sequence) * total;
        drawn[k] = count;
    }
    for (var i = 0u; i < count; i++) {
        let light = unshadowed_light(i, s);
        if !light.found {
            continue;
        }
        let share = luminance(light.irradiance);
        for (var k = 0u; k < EXACT_LIGHTS; k++) {
            // Until a draw has found its light, the latest one stands for it.
            if left[k] >= 0.0 {
                left[k] -= share;
                drawn[k] = i;
            }
        }
    }
    for (var k = 0u; k < EXACT_LIGHTS; k++) {
        if drawn[k] >= count {
            continue;
        }
        let light = unshadowed_light(drawn[k], s);
        let weight = total / luminance(light.irradiance) / f32(EXACT_LIGHTS);
        if is_light_seen(s, light) {
            sum += light.irradiance * weight;
        }
    }
    return sum;
}

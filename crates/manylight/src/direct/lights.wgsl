// Irradiance from sun, point and spot lights; twin of from_lights in mod.rs.

import package::emitter::direct_sample;
import package::math::color;
import package::math::sequence;
import package::shadow::shadow;

// Which lights are evaluated: all of few, else independent draws in proportion to the unshadowed
// luminance.
struct ChosenLights {
    // The number of lights where there is none.
    indices: array<u32, EXACT_LIGHTS>,
    // Sum of all luminances, of draws; 0: no draws.
    total: f32,
}

// What a light gives a receiver without visibility, its cosine included.
fn unshadowed_light(index: u32, s: SurfacePoint) -> DirectSample {
    var light = direct_sample(index, s.position);
    light.irradiance *= max(dot(s.ns, light.direction), 0.0);
    light.found = light.found && max_element(light.irradiance) > 0.0;
    return light;
}

fn choose_lights(s: SurfacePoint, sequence: ptr<function, Sequence>) -> ChosenLights {
    let count = sources[SOURCE_LIGHT_COUNT];
    var chosen = ChosenLights(array<u32, EXACT_LIGHTS>(), 0.0);
    for (var k = 0u; k < EXACT_LIGHTS; k++) {
        chosen.indices[k] = select(count, k, count <= EXACT_LIGHTS && k < count);
    }
    if count <= EXACT_LIGHTS {
        return chosen;
    }
    for (var i = 0u; i < count; i++) {
        let light = unshadowed_light(i, s);
        chosen.total += select(0.0, luminance(light.irradiance), light.found);
    }
    // All draws in one further look at the lights.
    var left: array<f32, EXACT_LIGHTS>;
    for (var k = 0u; k < EXACT_LIGHTS; k++) {
        left[k] = next_1d(sequence) * chosen.total;
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
                chosen.indices[k] = i;
            }
        }
    }
    return chosen;
}

// Choice `k` without visibility, over its probability.
fn chosen_light(chosen: ChosenLights, k: u32, s: SurfacePoint) -> DirectSample {
    var indices = chosen.indices;
    if indices[k] >= sources[SOURCE_LIGHT_COUNT] {
        return DirectSample(vec3f(0.0), 0.0, vec3f(0.0), false);
    }
    var light = unshadowed_light(indices[k], s);
    if light.found && chosen.total > 0.0 {
        light.irradiance *= chosen.total / luminance(light.irradiance) / f32(EXACT_LIGHTS);
    }
    return light;
}

// With visibility, W/m².
fn from_lights(s: SurfacePoint, sequence: ptr<function, Sequence>) -> vec3f {
    let chosen = choose_lights(s, sequence);
    var sum = vec3f(0.0);
    for (var k = 0u; k < EXACT_LIGHTS; k++) {
        let light = chosen_light(chosen, k, s);
        if light.found {
            if is_open(s, light.direction, light.distance) {
                sum += light.irradiance;
            }
        }
    }
    return sum;
}

// Sending a ray from a source; twin of Emitters::emit.

import package::emitter::punctual;
import package::emitter::sky;
import package::emitter::surface;
import package::math::sequence;

struct EmittedRay {
    // Clear of the source.
    origin: vec3f,
    // Whether there is any.
    found: bool,
    // Unit.
    direction: vec3f,
    // Of this ray if it were the only one, W.
    flux: vec3f,
}

struct BoxPoint {
    position: vec3f,
    // Projected, m².
    area: f32,
}

// Sends one ray; its flux is divided by the probability of everything drawn.
fn emit(sequence: ptr<function, Sequence>) -> EmittedRay {
    let choice = next_2d(sequence);
    let a = next_2d(sequence);
    let b = next_2d(sequence);
    let light_count = sources[SOURCE_LIGHT_COUNT];
    let count = light_count + 2u;
    let index = draw_source(sources[SOURCE_BY_FLUX], count, choice.x);
    var ray = EmittedRay(vec3f(0.0), false, vec3f(0.0), vec3f(0.0));
    if index >= count {
        return ray;
    }
    if index < light_count {
        ray = emit_punctual(punctual_light(index), choice.y, a);
    } else if index == light_count {
        ray = emit_surface(choice.y, a, b);
    } else if has_sky() {
        let sample = sky_sample(b);
        let start = point_on_box(-sample.direction, choice.y, a);
        let flux = sample.radiance * (start.area / sample.pdf_sa);
        ray = EmittedRay(start.position, true, -sample.direction, flux);
    }
    ray.flux /= source_pmf(sources[SOURCE_BY_FLUX], count, index);
    return ray;
}

fn emit_punctual(light: PunctualLight, choose: f32, u: vec2f) -> EmittedRay {
    if light.kind == KIND_SUN {
        let start = point_on_box(light.direction, choose, u);
        return EmittedRay(start.position, true, light.direction, light.intensity * start.area);
    }
    if light.kind == KIND_POINT {
        let flux = light.intensity * (4.0 * PI);
        return EmittedRay(light.position, true, uniform_sphere(u), flux);
    }
    let direction = uniform_cone(light.direction, light.cos_outer, u);
    let fade = spot_fade(dot(direction, light.direction), light.cos_outer, light.cos_inner);
    let flux = light.intensity * (fade * 2.0 * PI * (1.0 - light.cos_outer));
    return EmittedRay(light.position, true, direction, flux);
}

// A ray from a random point of the emissive triangles, cosine-distributed; twin of
// SurfaceEmitter::emit.
fn emit_surface(choose: f32, u: vec2f, w: vec2f) -> EmittedRay {
    let s = surface_sample(choose, u);
    var normal = s.normal;
    var sides = 1.0;
    var v = w;
    // A double-sided emitter uses the second number for the side as well.
    if s.double_sided {
        sides = 2.0;
        let is_front = w.x < 0.5;
        normal = select(-s.normal, s.normal, is_front);
        v.x = w.x * 2.0 - select(1.0, 0.0, is_front);
    }
    let origin = s.position + normal * ray_offset(s.position);
    let flux = s.radiance * (PI * sides / s.pdf_area);
    return EmittedRay(origin, s.found, cosine_hemisphere(normal, v), flux);
}

// A point where parallel rays enter the (slightly widened) box of the scene, uniform over its
// projection.
fn point_on_box(direction: vec3f, choose: f32, u: vec2f) -> BoxPoint {
    let margin = max_element(scene.bounds_high - scene.bounds_low) * 1e-4 + 1e-6;
    let low = scene.bounds_low - margin;
    let high = scene.bounds_high + margin;
    let size = high - low;
    let faces = size.yzx * size.zxy * abs(direction);
    let total = faces.x + faces.y + faces.z;
    let goal = choose * total;
    let side = select(high, low, direction > vec3f(0.0));
    var p: vec3f;
    if goal < faces.x {
        p = vec3f(side.x, low.yz + u * size.yz);
    } else if goal < faces.x + faces.y {
        p = vec3f(low.x + u.y * size.x, side.y, low.z + u.x * size.z);
    } else {
        p = vec3f(low.xy + u * size.xy, side.z);
    }
    return BoxPoint(p, total);
}

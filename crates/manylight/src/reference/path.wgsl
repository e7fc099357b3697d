// One camera path with next-event estimation and multiple importance sampling; twin of
// PathTracer.

import package::direct::lights;
import package::emitter::sky;
import package::emitter::surface;
import package::math::sequence;
import package::math::warp;
import package::shadow::shadow;
import package::surface::point;
import package::surface::view;
import package::world::rays;

// Radiance of one camera path, split by the length of the light's way.
struct PathSample {
    // What the camera sees shine.
    emission: vec3f,
    // One surface between light and eye.
    direct: vec3f,
    // Two or more.
    indirect: vec3f,
}

// Weight of a sample of density `own` where another strategy has density `other`.
fn power_heuristic(own: f32, other: f32) -> f32 {
    if own <= 0.0 {
        return 0.0;
    }
    let ratio = other / own;
    return 1.0 / (1.0 + ratio * ratio);
}

fn emitter_irradiance(s: SurfacePoint, e: SurfaceSample) -> vec3f {
    let offset = e.position - s.position;
    let dist_sq = dot(offset, offset);
    let direction = normalize_or_zero(offset);
    let facing = -dot(e.normal, direction);
    let cos_light = select(facing, abs(facing), e.double_sided);
    let cos_theta = dot(s.ns, direction);
    if !e.found || !(cos_theta > 0.0 && cos_light > 0.0) || all(e.radiance == vec3f(0.0)) {
        return vec3f(0.0);
    }
    if !is_seen(s, e.position, select(-e.normal, e.normal, facing > 0.0)) {
        return vec3f(0.0);
    }
    let pdf_sa = e.pdf_area * dist_sq / cos_light;
    return e.radiance * (cos_theta / pdf_sa * power_heuristic(pdf_sa, cos_theta / PI));
}

// Irradiance by looking for the light: all kinds of sources.
fn next_event(s: SurfacePoint, seq: ptr<function, Sequence>) -> vec3f {
    var sum = from_lights(s, seq);
    if has_surface_emitter() {
        let choose = next_1d(seq);
        let u = next_2d(seq);
        sum += emitter_irradiance(s, surface_sample(choose, u));
    }
    if sky_is_map() {
        let sample = sky_sample(next_2d(seq));
        let cos_theta = max(dot(s.ns, sample.direction), 0.0);
        if cos_theta > 0.0 {
            if is_open(s, sample.direction, FAR_AWAY) {
                let weight = power_heuristic(sample.pdf_sa, cos_theta / PI);
                sum += sample.radiance * (cos_theta / sample.pdf_sa * weight);
            }
        }
    }
    return sum;
}

// Weight of an emitter met by reflection.
fn emitter_weight(hit: Hit, next: SurfacePoint, ray: Ray, pdf_sa: f32) -> f32 {
    let pdf_area = surface_pdf_area(hit.instance, hit.triangle);
    let cos_light = abs(dot(next.ng, ray.direction));
    let offset = next.position - ray.origin;
    return power_heuristic(pdf_sa, pdf_area * dot(offset, offset) / max(cos_light, 1e-9));
}

// Weight of the sky met by reflection: all of it for a constant sky.
fn sky_weight(direction: vec3f, pdf_sa: f32) -> f32 {
    if sky_is_map() {
        return power_heuristic(pdf_sa, sky_pdf_sa(direction));
    }
    return 1.0;
}

// Traces one path through a point of a pixel, jittered over the pixel's area.
fn trace_path(
    view: View,
    pixel: vec2u,
    bounces: u32,
    normal_maps: bool,
    seq: ptr<function, Sequence>,
) -> PathSample {
    let start = view_ray(view, vec2f(pixel) + next_2d(seq));
    var ray = Ray(start.origin, FAR_AWAY, start.direction);
    var sample = PathSample(vec3f(0.0), vec3f(0.0), vec3f(0.0));
    let first = closest(ray);
    if first.instance == NO_HIT {
        sample.emission = sky_radiance(ray.direction);
        return sample;
    }
    var s = surface_at(first, ray.direction, normal_maps);
    sample.emission = s.emission;
    var throughput = vec3f(1.0);
    for (var vertex = 0u; vertex <= bounces; vertex++) {
        if all(s.albedo == vec3f(0.0)) {
            break;
        }
        throughput *= s.albedo;
        var layer = throughput / PI * next_event(s, seq);

        // One reflection finds emitters and the sky a second way, and the next surface.
        let direction = cosine_hemisphere(s.ns, next_2d(seq));
        // Below the surface itself: blocked, as for shadow rays.
        let is_above = dot(s.ng, direction) > 0.0;
        var hit = Hit(0.0, vec2f(0.0), NO_HIT, 0u);
        if is_above {
            ray = Ray(ray_origin(s), FAR_AWAY, direction);
            hit = closest(ray);
            let pdf_sa = max(dot(s.ns, direction), 0.0) / PI;
            if hit.instance == NO_HIT {
                layer += throughput * sky_radiance(direction) * sky_weight(direction, pdf_sa);
            } else {
                s = surface_at(hit, direction, normal_maps);
                if any(s.emission != vec3f(0.0)) && !s.unlit {
                    layer += throughput * s.emission * emitter_weight(hit, s, ray, pdf_sa);
                }
            }
        }
        if vertex == 0u {
            sample.direct += layer;
        } else {
            sample.indirect += layer;
        }
        if hit.instance == NO_HIT {
            break;
        }
    }
    return sample;
}

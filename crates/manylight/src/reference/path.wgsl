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

// Lights that a surface may ask for: the chosen ones, an emitter, the sky.
const CANDIDATES = EXACT_LIGHTS + 2u;

// Light that a shadow ray decides about.
struct Candidate {
    ray: Ray,
    // Over its density and weighted, W/m²; 0: no ray is needed.
    irradiance: vec3f,
}

fn light_candidate(s: SurfacePoint, light: DirectSample) -> Candidate {
    let ray = open_ray(s, light.direction, light.distance);
    return Candidate(ray, select(vec3f(0.0), light.irradiance, light.found));
}

fn emitter_candidate(s: SurfacePoint, e: SurfaceSample) -> Candidate {
    let offset = e.position - s.position;
    let dist_sq = dot(offset, offset);
    let direction = normalize_or_zero(offset);
    let facing = -dot(e.normal, direction);
    let cos_light = select(facing, abs(facing), e.double_sided);
    let cos_theta = dot(s.ns, direction);
    let ray = segment_ray(ray_origin(s), e.position, select(-e.normal, e.normal, facing > 0.0));
    if !e.found || !(cos_theta > 0.0 && cos_light > 0.0) || all(e.radiance == vec3f(0.0)) {
        return Candidate(ray, vec3f(0.0));
    }
    let pdf_sa = e.pdf_area * dist_sq / cos_light;
    let weight = power_heuristic(pdf_sa, cos_theta / PI);
    return Candidate(ray, e.radiance * (cos_theta / pdf_sa * weight));
}

fn sky_candidate(s: SurfacePoint, sample: SkySample) -> Candidate {
    let ray = open_ray(s, sample.direction, FAR_AWAY);
    let cos_theta = max(dot(s.ns, sample.direction), 0.0);
    if !(cos_theta > 0.0) {
        return Candidate(ray, vec3f(0.0));
    }
    let weight = power_heuristic(sample.pdf_sa, cos_theta / PI);
    return Candidate(ray, sample.radiance * (cos_theta / sample.pdf_sa * weight));
}

// The next light of a surface that needs a shadow ray, from the one numbered `next` on: the chosen
// lights, a point on an emitter, a direction of the sky. None are left where it is black.
fn next_candidate(
    s: SurfacePoint,
    chosen: ChosenLights,
    next: ptr<function, u32>,
    seq: ptr<function, Sequence>,
) -> Candidate {
    var candidate = Candidate(Ray(vec3f(0.0), 0.0, vec3f(0.0)), vec3f(0.0));
    while *next < CANDIDATES && all(candidate.irradiance == vec3f(0.0)) {
        let k = *next;
        *next = k + 1u;
        if k < EXACT_LIGHTS {
            candidate = light_candidate(s, chosen_light(chosen, k, s));
        } else if k == EXACT_LIGHTS && has_surface_emitter() {
            let choose = next_1d(seq);
            candidate = emitter_candidate(s, surface_sample(choose, next_2d(seq)));
        } else if k > EXACT_LIGHTS && sky_is_map() {
            candidate = sky_candidate(s, sky_sample(next_2d(seq)));
        }
    }
    return candidate;
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

// Adds what reaches the eye from surface `vertex` of its path.
fn add_light(sample: ptr<function, PathSample>, vertex: u32, radiance: vec3f) {
    if vertex == 0u {
        (*sample).direct += radiance;
    } else {
        (*sample).indirect += radiance;
    }
}

// Radiance of what a ray met, or of the sky, as much of it as belongs to reflection.
fn radiance_met(hit: Hit, s: SurfacePoint, ray: Ray, vertex: u32, pdf_sa: f32) -> vec3f {
    if hit.instance == NO_HIT {
        return sky_radiance(ray.direction)
            * select(sky_weight(ray.direction, pdf_sa), 1.0, vertex == 0u);
    }
    if vertex == 0u || all(s.emission == vec3f(0.0)) {
        return s.emission;
    }
    return s.emission * select(emitter_weight(hit, s, ray, pdf_sa), 0.0, s.unlit);
}

// Traces one path through a point of a pixel, jittered over the pixel's area.
//
// Rays of all kinds are traced in one place: the camera's or a reflection, then shadow rays of the
// surface that it met, one after the other, then the next reflection.
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
    var throughput = vec3f(1.0);
    var pdf_sa = 0.0;
    var vertex = 0u;
    // Of the latest surface: its lights, which of them is next, and the sum of those that are seen.
    var s: SurfacePoint;
    var chosen: ChosenLights;
    var next = 0u;
    var sum = vec3f(0.0);
    // Black while the ray is no shadow ray.
    var awaited = vec3f(0.0);
    for (var step = 0u; step < (bounces + 2u) * (CANDIDATES + 1u); step++) {
        let is_shadow = any(awaited != vec3f(0.0));
        let hit = trace_ray(ray, is_shadow);
        if is_shadow {
            sum += select(vec3f(0.0), awaited, hit.instance == NO_HIT);
        } else {
            if hit.instance != NO_HIT {
                s = surface_at(hit, ray.direction, normal_maps);
            }
            let found = radiance_met(hit, s, ray, vertex, pdf_sa);
            if vertex == 0u {
                sample.emission = found;
            } else if any(found != vec3f(0.0)) {
                add_light(&sample, vertex - 1u, throughput * found);
            }
            if hit.instance == NO_HIT || vertex > bounces || all(s.albedo == vec3f(0.0)) {
                break;
            }
            throughput *= s.albedo;
            chosen = choose_lights(s, seq);
            next = 0u;
            sum = vec3f(0.0);
        }
        let candidate = next_candidate(s, chosen, &next, seq);
        awaited = candidate.irradiance;
        if any(awaited != vec3f(0.0)) {
            ray = candidate.ray;
            continue;
        }
        add_light(&sample, vertex, throughput / PI * sum);

        let direction = cosine_hemisphere(s.ns, next_2d(seq));
        // Below the surface itself: blocked, as for shadow rays.
        if dot(s.ng, direction) <= 0.0 {
            break;
        }
        ray = Ray(ray_origin(s), FAR_AWAY, direction);
        pdf_sa = max(dot(s.ns, direction), 0.0) / PI;
        vertex += 1u;
    }
    return sample;
}

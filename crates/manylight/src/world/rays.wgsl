// Rays against the scene; twin of World::closest and World::occluded.
import package::bvh::traverse;
import package::world::walk;

// What a ray meets; nothing if it has no place.
fn trace_ray(ray: Ray, any: bool) -> Hit {
    if !is_finite_ray(ray) {
        return Hit(ray.t_max, vec2f(0.0), NO_HIT, 0u);
    }
    return walk_scene(ray, any);
}

// The nearest surface along a ray.
fn closest(ray: Ray) -> Hit {
    return trace_ray(ray, false);
}

// Whether anything stops a ray.
fn occluded(ray: Ray) -> bool {
    return trace_ray(ray, true).instance != NO_HIT;
}

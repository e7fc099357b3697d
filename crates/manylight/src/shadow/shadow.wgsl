// Shadow rays between a receiver and a light; twin of mod.rs.

import package::surface::point;
import package::world::rays;

// A ray in a direction (unit; `distance` may be FAR_AWAY).
fn open_ray(s: SurfacePoint, direction: vec3f, distance: f32) -> Ray {
    let t_max = select(distance * SEGMENT_END, FAR_AWAY, distance >= FAR_AWAY);
    return Ray(ray_origin(s), t_max, direction);
}

// A ray to a point in space.
fn point_ray(origin: vec3f, goal: vec3f) -> Ray {
    return Ray(origin, SEGMENT_END, goal - origin);
}

// A ray to a point on another surface, whose lit side has this normal.
fn segment_ray(origin: vec3f, position: vec3f, normal: vec3f) -> Ray {
    return point_ray(origin, position + normal * ray_offset(position));
}

// Whether a direction (unit, `distance` may be FAR_AWAY) is free of obstacles.
fn is_open(s: SurfacePoint, direction: vec3f, distance: f32) -> bool {
    return !occluded(open_ray(s, direction, distance));
}

// Whether a point on another surface, whose lit side has this normal, is seen.
fn is_seen(s: SurfacePoint, position: vec3f, normal: vec3f) -> bool {
    return !occluded(segment_ray(ray_origin(s), position, normal));
}

// Shadow rays between a receiver and a light; twin of mod.rs.

import package::surface::point;
import package::world::rays;

// Whether a direction (unit, `distance` may be FAR_AWAY) is free of obstacles.
fn is_open(s: SurfacePoint, direction: vec3f, distance: f32) -> bool {
    let t_max = select(distance * SEGMENT_END, FAR_AWAY, distance >= FAR_AWAY);
    return !occluded(Ray(ray_origin(s), t_max, direction));
}

// Whether a point on another surface, whose lit side has this normal, is seen.
fn is_seen(s: SurfacePoint, position: vec3f, normal: vec3f) -> bool {
    let origin = ray_origin(s);
    let goal = position + normal * ray_offset(position);
    return !occluded(Ray(origin, SEGMENT_END, goal - origin));
}

// The way of a ray through the scene where the hardware follows it; stands for walk.wgsl.
enable wgpu_ray_query;
import package::bvh::traverse;
import package::world::alpha;
import package::world::scene;

// Its instances are the placements, each with up to two lists of triangles: those that stop every
// ray, and those with holes.
@group(1) @binding(6) var hardware_tree: acceleration_structure;

// A triangle that the hardware found.
struct Met {
    // Distance and barycentrics are those that the walk by shaders finds, where its test agrees
    // that the ray meets the triangle.
    hit: Hit,
    is_sure: bool,
    is_opaque: bool,
    // Of hits at the same distance the least counts: copied triangles before those of shared
    // meshes, then by the builder's list.
    order: u32,
}

// Words of a placement: object from world (12), instance, first triangles of both lists. Instance
// NONE is that of the triangle.
fn meet_triangle(ray: Ray, found: RayIntersection) -> Met {
    let at = scene.placements + found.instance_index * PLACEMENT_WORDS;
    let place = 3u * (geometry[at + 13u + found.geometry_index] + found.primitive_index);
    let corner = bvh_triangles[place];
    let edge1 = bvh_triangles[place + 1u];
    let edge2 = bvh_triangles[place + 2u];
    let instance = geometry[at + 12u];
    let owner = select(instance, bitcast<u32>(corner.w), instance == NONE);
    let linear = geometry_mat3(at);
    let local = Ray(linear * ray.origin + geometry_vec3(at + 9u), ray.t_max,
        linear * ray.direction);
    let met = intersect_triangle(corner.xyz, edge1.xyz, edge2.xyz, local, ray.t_max);
    let is_sure = met.x > 0.0;
    let place_met = select(vec3f(found.t, found.barycentrics), met, is_sure);
    let words = bitcast<u32>(edge2.w);
    let order = (words >> 1u) | select(0x80000000u, 0u, instance == NONE);
    let hit = Hit(place_met.x, place_met.yz, owner, bitcast<u32>(edge1.w));
    return Met(hit, is_sure, (words & 1u) != 0u, order);
}

// Of the triangles about as far away as the nearest the one that the walk by shaders meets: the
// hardware promises no order.
fn first_of_nearest(ray: Ray, nearest: Met, end: f32) -> Hit {
    var best = nearest;
    var query: ray_query;
    rayQueryInitialize(&query, hardware_tree,
        RayDesc(RAY_FLAG_FORCE_NO_OPAQUE, 0xffu, 0.0, end, ray.origin, ray.direction));
    while rayQueryProceed(&query) {
        let met = meet_triangle(ray, rayQueryGetCandidateIntersection(&query));
        let is_before = met.hit.t < best.hit.t
            || (met.hit.t == best.hit.t && met.order < best.order);
        if met.is_sure && (is_before || !best.is_sure) {
            if met.is_opaque || stops(ray, met.hit.instance, met.hit.triangle, met.hit.uv) {
                best = met;
            }
        }
    }
    return best.hit;
}

// What a ray meets: the nearest hit, or any.
fn walk_scene(ray: Ray, any: bool) -> Hit {
    let miss = Hit(ray.t_max, vec2f(0.0), NO_HIT, 0u);
    // Without a length or an end the hardware may do as it likes.
    if !(ray.t_max > 0.0) || all(ray.direction == vec3f(0.0)) {
        return miss;
    }
    let flags = select(RAY_FLAG_NONE, RAY_FLAG_TERMINATE_ON_FIRST_HIT, any);
    var query: ray_query;
    rayQueryInitialize(&query, hardware_tree,
        RayDesc(flags, 0xffu, 0.0, ray.t_max, ray.origin, ray.direction));
    // Only triangles with holes are asked about; each once, or again with the same answer.
    while rayQueryProceed(&query) {
        let met = meet_triangle(ray, rayQueryGetCandidateIntersection(&query));
        if stops(ray, met.hit.instance, met.hit.triangle, met.hit.uv) {
            rayQueryConfirmIntersection(&query);
        }
    }
    let found = rayQueryGetCommittedIntersection(&query);
    if found.kind == RAY_QUERY_INTERSECTION_NONE {
        return miss;
    }
    let met = meet_triangle(ray, found);
    if any {
        return met.hit;
    }
    let end = max(met.hit.t, found.t) * (1.0 + TIE_SLACK);
    return first_of_nearest(ray, met, min(end, ray.t_max));
}

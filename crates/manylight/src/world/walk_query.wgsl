// The way of a ray through the scene where the hardware follows it; stands for walk.wgsl.
enable wgpu_ray_query;
import package::bvh::traverse;
import package::world::alpha;
import package::world::scene;

// Its instances are the placements, each with up to two lists of triangles: those that stop every
// ray, and those with holes.
@group(1) @binding(6) var hardware_tree: acceleration_structure;

// The hit of a triangle that the hardware found. Distance and barycentrics are those that the walk
// by shaders finds, where its test agrees that the ray meets the triangle.
//
// Words of a placement: object from world (12), instance, first triangles of both lists. Instance
// NONE is that of the triangle.
fn meet_triangle(ray: Ray, placement: u32, list: u32, index: u32, t: f32, uv: vec2f) -> Hit {
    let at = scene.placements + placement * PLACEMENT_WORDS;
    let place = 3u * (geometry[at + 13u + list] + index);
    let corner = bvh_triangles[place];
    let edge1 = bvh_triangles[place + 1u];
    let edge2 = bvh_triangles[place + 2u];
    let instance = geometry[at + 12u];
    let owner = select(instance, bitcast<u32>(corner.w), instance == NONE);
    let linear = geometry_mat3(at);
    let local = Ray(linear * ray.origin + geometry_vec3(at + 9u), ray.t_max,
        linear * ray.direction);
    let met = intersect_triangle(corner.xyz, edge1.xyz, edge2.xyz, local, ray.t_max);
    let place_met = select(vec3f(t, uv), met, met.x > 0.0);
    return Hit(place_met.x, place_met.yz, owner, bitcast<u32>(edge1.w));
}

// What a ray meets: the nearest hit, or any. Among hits at the same distance the hardware chooses.
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
        let found = rayQueryGetCandidateIntersection(&query);
        let hit = meet_triangle(ray, found.instance_index, found.geometry_index,
            found.primitive_index, found.t, found.barycentrics);
        if stops(ray, hit.instance, hit.triangle, hit.uv) {
            rayQueryConfirmIntersection(&query);
        }
    }
    let found = rayQueryGetCommittedIntersection(&query);
    if found.kind == RAY_QUERY_INTERSECTION_NONE {
        return miss;
    }
    return meet_triangle(ray, found.instance_index, found.geometry_index, found.primitive_index,
        found.t, found.barycentrics);
}

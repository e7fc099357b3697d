// The way of a ray through the scene where the hardware follows it; stands for walk.wgsl.
enable wgpu_ray_query;
import package::bvh::traverse;
import package::world::alpha;
import package::world::scene;

// Its instances are the placements, each with up to two lists of triangles: those that stop every
// ray, and those with holes.
@group(1) @binding(6) var hardware_tree: acceleration_structure;

// Instance and triangle of a hit.
//
// Words of a placement: object from world (12), instance, first triangles of both lists. Instance
// NONE is that of the triangle.
fn met_triangle(placement: u32, list: u32, index: u32) -> vec2u {
    let at = scene.placements + placement * PLACEMENT_WORDS + 12u;
    let place = 3u * (geometry[at + 1u + list] + index);
    let instance = geometry[at];
    let own = bitcast<u32>(bvh_triangles[place].w);
    let triangle = bitcast<u32>(bvh_triangles[place + 1u].w);
    return vec2u(select(instance, own, instance == NONE), triangle);
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
        let candidate = rayQueryGetCandidateIntersection(&query);
        let met = met_triangle(candidate.instance_index, candidate.geometry_index,
            candidate.primitive_index);
        if stops(ray, met.x, met.y, candidate.barycentrics) {
            rayQueryConfirmIntersection(&query);
        }
    }
    let found = rayQueryGetCommittedIntersection(&query);
    if found.kind == RAY_QUERY_INTERSECTION_NONE {
        return miss;
    }
    let met = met_triangle(found.instance_index, found.geometry_index, found.primitive_index);
    return Hit(found.t, found.barycentrics, met.x, met.y);
}

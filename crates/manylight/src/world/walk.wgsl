// The way of a ray through the hierarchies of the scene.
import package::bvh::traverse;
import package::world::alpha;
import package::world::scene;

fn load_groups(node: u32, setup: RaySetup, t_max: f32) -> Groups {
    let at = 5u * node;
    return visit_node(bvh_nodes[at], bvh_nodes[at + 1u], bvh_nodes[at + 2u], bvh_nodes[at + 3u],
        bvh_nodes[at + 4u], setup, t_max);
}

// Takes the nearest of the children that wait; its position from the root.
fn take_child(nodes: ptr<function, vec2u>, setup: RaySetup) -> u32 {
    let bit = firstLeadingBit((*nodes).y);
    let slot = (bit - 24u) ^ setup.octant;
    (*nodes).y &= ~(1u << bit);
    return (*nodes).x + countOneBits((*nodes).y & 0xffu & ~(0xffffffffu << slot));
}

// What a ray meets in one hierarchy; `local` is the ray in its space, `instance` replaces that of
// the triangles unless it is NONE. With `any` the first hit that is found ends the walk.
fn walk_tree(ray: Ray, local: Ray, root: u32, first: u32, instance: u32, any: bool) -> Hit {
    var hit = Hit(local.t_max, vec2f(0.0), NO_HIT, 0u);
    // Of hits at the same distance the one earlier in the builder's list counts.
    var best = 0u;
    let setup = setup_ray(local);
    var stack: array<vec2u, STACK>;
    var size = 0u;
    var nodes = vec2u(0u, 0x80000000u);
    loop {
        var triangles = vec2u(0u);
        if nodes.y > 0xffffffu {
            // The nearest child that waits; the rest goes to the stack.
            let node = root + take_child(&nodes, setup);
            if nodes.y > 0xffffffu && size < STACK {
                stack[size] = nodes;
                size++;
            }
            let groups = load_groups(node, setup, hit.t);
            nodes = groups.nodes;
            triangles = groups.triangles;
        }
        while triangles.y != 0u {
            let bit = firstLeadingBit(triangles.y);
            triangles.y &= ~(1u << bit);
            let at = 3u * (first + triangles.x + bit);
            let corner = bvh_triangles[at];
            let edge1 = bvh_triangles[at + 1u];
            let edge2 = bvh_triangles[at + 2u];
            let met = intersect_triangle(corner.xyz, edge1.xyz, edge2.xyz, local, hit.t);
            let place = bitcast<u32>(edge2.w) >> 1u;
            if met.x > 0.0 && (met.x < hit.t || place < best) {
                let owner = select(instance, bitcast<u32>(corner.w), instance == NONE);
                let triangle = bitcast<u32>(edge1.w);
                let is_opaque = (bitcast<u32>(edge2.w) & 1u) != 0u;
                if is_opaque || stops(ray, owner, triangle, met.yz) {
                    hit = Hit(met.x, met.yz, owner, triangle);
                    best = place;
                    if any {
                        return hit;
                    }
                }
            }
        }
        if nodes.y <= 0xffffffu {
            if size == 0u {
                break;
            }
            size--;
            nodes = stack[size];
        }
    }
    return hit;
}

// The nearest hit in instances of shared meshes, no farther than one that is known.
//
// Words of a placement: object from world (12, columns), instance, root, first triangle.
fn walk_placements(ray: Ray, known: Hit, any: bool) -> Hit {
    var hit = known;
    let setup = setup_ray(ray);
    var stack: array<vec2u, STACK>;
    var size = 0u;
    var nodes = vec2u(0u, 0x80000000u);
    loop {
        var items = vec2u(0u);
        if nodes.y > 0xffffffu {
            let node = scene.placement_root + take_child(&nodes, setup);
            if nodes.y > 0xffffffu && size < STACK {
                stack[size] = nodes;
                size++;
            }
            let groups = load_groups(node, setup, hit.t);
            nodes = groups.nodes;
            items = groups.triangles;
        }
        while items.y != 0u {
            let bit = firstLeadingBit(items.y);
            items.y &= ~(1u << bit);
            let item = geometry[scene.placement_items + items.x + bit];
            let at = scene.placements + item * PLACEMENT_WORDS;
            let linear = geometry_mat3(at);
            let local = Ray(linear * ray.origin + geometry_vec3(at + 9u), hit.t,
                linear * ray.direction);
            let met = walk_tree(ray, local, geometry[at + 13u], geometry[at + 14u],
                geometry[at + 12u], any);
            if met.instance != NO_HIT {
                hit = met;
                if any {
                    return hit;
                }
            }
        }
        if nodes.y <= 0xffffffu {
            if size == 0u {
                break;
            }
            size--;
            nodes = stack[size];
        }
    }
    return hit;
}

// What a ray meets: the nearest hit, or any.
fn walk_scene(ray: Ray, any: bool) -> Hit {
    var hit = Hit(ray.t_max, vec2f(0.0), NO_HIT, 0u);
    if scene.flat_count > 0u {
        hit = walk_tree(ray, ray, 0u, 0u, NONE, any);
    }
    let is_stopped = any && hit.instance != NO_HIT;
    if HAS_PLACEMENTS && scene.placement_count > 0u && !is_stopped {
        hit = walk_placements(ray, hit, any);
    }
    return hit;
}

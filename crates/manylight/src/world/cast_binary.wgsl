// Which of a list of rays are stopped, by way of a binary hierarchy.
import package::bvh::traverse_binary;
import package::world::alpha;

struct CastParams {
    count: u32,
    // Whether any hit will do: always here.
    any: u32,
}

@group(0) @binding(0) var<uniform> params: CastParams;
// Origin and t_max, direction.
@group(0) @binding(1) var<storage, read> rays: array<array<vec4f, 2>>;
@group(0) @binding(2) var<storage, read> nodes: array<BinaryNode>;
// As those of the scene, in the order of the leaves.
@group(0) @binding(3) var<storage, read> triangles: array<array<vec4f, 3>>;
@group(0) @binding(4) var<storage, read_write> stopped: array<u32>;

fn is_stopped_in_leaf(ray: Ray, first: u32, count: u32) -> bool {
    for (var i = first; i < first + count; i++) {
        let corner = triangles[i][0];
        let edge1 = triangles[i][1];
        let edge2 = triangles[i][2];
        let met = intersect_triangle(corner.xyz, edge1.xyz, edge2.xyz, ray, ray.t_max);
        if met.x > 0.0 && met.x < ray.t_max {
            let is_opaque = (bitcast<u32>(edge2.w) & 1u) != 0u;
            if is_opaque || stops(ray, bitcast<u32>(corner.w), bitcast<u32>(edge1.w), met.yz) {
                return true;
            }
        }
    }
    return false;
}

// Whether anything stops a ray; nearer boxes first.
fn is_stopped(ray: Ray) -> bool {
    let setup = setup_ray(ray);
    var stack: array<u32, BINARY_STACK>;
    var size = 0u;
    var node = nodes[0];
    loop {
        if node.count > 0u {
            if is_stopped_in_leaf(ray, node.first, node.count) {
                return true;
            }
        } else {
            let a = nodes[node.first];
            let b = nodes[node.first + 1u];
            let t_a = enter_box(a, setup, ray.t_max);
            let t_b = enter_box(b, setup, ray.t_max);
            if min(t_a, t_b) < FAR_AWAY {
                let is_a_first = t_a <= t_b;
                if max(t_a, t_b) < FAR_AWAY && size < BINARY_STACK {
                    stack[size] = node.first + u32(is_a_first);
                    size++;
                }
                if is_a_first {
                    node = a;
                } else {
                    node = b;
                }
                continue;
            }
        }
        if size == 0u {
            return false;
        }
        size--;
        node = nodes[stack[size]];
    }
    return false;
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let index = (group.y * groups.x + group.x) * GROUP_X + local;
    if index >= params.count {
        return;
    }
    let start = rays[index][0];
    let ray = Ray(start.xyz, start.w, rays[index][1].xyz);
    stopped[index] = u32(is_finite_ray(ray) && is_stopped(ray));
}

// A list of rays against the scene.
import package::world::rays;

struct CastParams {
    count: u32,
    // Whether any hit will do.
    any: u32,
}

struct HitRecord {
    t: f32,
    u: f32,
    v: f32,
    instance: u32,
    triangle: u32,
}

@group(0) @binding(0) var<uniform> params: CastParams;
// Origin and t_max, direction.
@group(0) @binding(1) var<storage, read> rays: array<array<vec4f, 2>>;
@group(0) @binding(2) var<storage, read_write> hits: array<HitRecord>;

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
    let hit = trace_ray(Ray(start.xyz, start.w, rays[index][1].xyz), params.any != 0u);
    hits[index] = HitRecord(hit.t, hit.uv.x, hit.uv.y, hit.instance, hit.triangle);
}

// One ray through every pixel: the G-buffer; twin of Receivers::trace. What the sky gives to pixels
// without a surface is added elsewhere.
import package::surface::octahedral;
import package::surface::point;
import package::surface::view;

struct ReceiverParams {
    view: View,
    normal_maps: u32,
    first_row: u32,
}

@group(0) @binding(0) var<uniform> params: ReceiverParams;
@group(0) @binding(1) var<storage, read_write> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> normals: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> albedos: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> emissions: array<vec4f>;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let view = params.view;
    let at = id.xy + vec2u(0u, params.first_row);
    if at.x >= view.width || at.y >= view.height {
        return;
    }
    let pixel = at.y * view.width + at.x;
    let offset = vec2f(view.offset_x, view.offset_y);
    let ray = view_ray(view, vec2f(at) + offset);
    let hit = closest(Ray(ray.origin, FAR_AWAY, ray.direction));
    if hit.instance == NO_HIT {
        positions[pixel] = vec4f(vec3f(0.0), NO_SURFACE);
        normals[pixel] = vec4f(0.0);
        albedos[pixel] = vec4f(0.0);
        emissions[pixel] = vec4f(0.0);
        return;
    }
    let s = surface_at(hit, ray.direction, params.normal_maps != 0u);
    positions[pixel] = vec4f(s.position, view_depth(view, s.position));
    normals[pixel] = vec4f(s.ns, bitcast<f32>(pack_octahedral(s.ng)));
    albedos[pixel] = vec4f(s.albedo, 0.0);
    emissions[pixel] = vec4f(s.emission, 0.0);
}

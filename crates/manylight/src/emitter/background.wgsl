// What the sky gives to pixels that see no surface.
import package::emitter::sky;
import package::surface::view;

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> emissions: array<vec4f>;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= view.width || id.y >= view.height || !has_sky() {
        return;
    }
    let pixel = id.y * view.width + id.x;
    if positions[pixel].w >= NO_SURFACE {
        let ray = view_ray(view, vec2f(id.xy) + vec2f(view.offset_x, view.offset_y));
        emissions[pixel] = vec4f(sky_radiance(ray.direction), 0.0);
    }
}

// Camera rays; twin of ViewFrame.
import package::math::warp;

struct View {
    position: vec3f,
    width: u32,
    forward: vec3f,
    height: u32,
    // Half the picture's extent: at distance 1, or in metres if orthographic.
    half_right: vec3f,
    perspective: u32,
    half_up: vec3f,
    // Where in a pixel rays start, from its top left corner.
    offset_x: f32,
    offset_y: f32,
}

struct ViewRay {
    origin: vec3f,
    direction: vec3f,
}

// The ray through a point of the picture, in pixels from the top left; unit direction.
fn view_ray(view: View, point: vec2f) -> ViewRay {
    let x = 2.0 * point.x / f32(view.width) - 1.0;
    let y = 1.0 - 2.0 * point.y / f32(view.height);
    let offset = view.half_right * x + view.half_up * y;
    if view.perspective != 0u {
        return ViewRay(view.position, unit(view.forward + offset));
    }
    return ViewRay(view.position + offset, view.forward);
}

// Distance along the viewing axis, m.
fn view_depth(view: View, p: vec3f) -> f32 {
    return dot(p - view.position, view.forward);
}

// The virtual lights around a vertex of level 1; for kernels that bind `cells`, `vpls`, `points`.
import package::vlight::vpl::record;
import package::gather::grid::gpu::build::moments;

fn lights_in(cell: u32) -> u32 {
    if cell == NONE {
        return 0u;
    }
    return cells[cell + 1u].light - cells[cell].light;
}

// Adds every `step`th light from the `first` on of the cell in one octant around a vertex.
fn add_vpls(sum: ptr<function, Moments>, cell: u32, octant: u32, vertex: vec3u, first: u32,
    step: u32) {
    if cell == NONE {
        return;
    }
    let above = (vec3u(octant, octant >> 1u, octant >> 2u) & vec3u(1u)) == vec3u(1u);
    let corner = select(vec3f(vertex) - 1.0, vec3f(vertex), above);
    let end = cells[cell + 1u].light;
    for (var i = cells[cell].light + first; i < end; i += step) {
        let inside = clamp(points[i].xyz - corner, vec3f(0.0), vec3f(1.0));
        let offset = select(inside - 1.0, inside, above);
        let hat = 1.0 - abs(offset);
        let light = vec4f(vpls[i].intensity, points[i].w);
        add_share(sum, light, vpls[i].normal, hat.x * hat.y * hat.z, offset, vec3f(0.0));
    }
}

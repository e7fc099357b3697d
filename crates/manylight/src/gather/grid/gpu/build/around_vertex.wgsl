// The virtual lights around a vertex of level 1; for kernels that bind `cells`, `vpls`, `points`.
import package::vlight::vpl::record;
import package::gather::grid::gpu::build::moments;

fn count_around(around: array<u32, 8>) -> u32 {
    var found = around;
    var count = 0u;
    for (var octant = 0u; octant < 8u; octant++) {
        let cell = found[octant];
        if cell != NONE {
            count += cells[cell + 1u].light - cells[cell].light;
        }
    }
    return count;
}

// Adds every `step`th light from the `first` on.
fn add_vpls(sum: ptr<function, Moments>, around: array<u32, 8>, vertex: vec3u, first: u32,
    step: u32) {
    var found = around;
    for (var octant = 0u; octant < 8u; octant++) {
        let cell = found[octant];
        if cell == NONE {
            continue;
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
}

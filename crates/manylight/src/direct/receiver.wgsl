// A receiver as shadow rays need it, from its planes; the rest of the surface is black.

import package::surface::octahedral;
import package::surface::point;

fn bare_receiver(position: vec4f, normal: vec4f) -> SurfacePoint {
    let ng = unpack_octahedral(bitcast<u32>(normal.w));
    return SurfacePoint(position.xyz, ng, normal.xyz, vec3f(0.0), vec3f(0.0), false);
}

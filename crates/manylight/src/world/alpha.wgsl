// Which texels of a surface are there for a ray; twin of alpha.rs.
import package::bvh::traverse;
import package::math::sequence;
import package::world::scene;
import package::world::texture;

// Opacity of a triangle at a point: texture, factor and vertex color.
fn opacity_at(instance: u32, triangle: u32, uv: vec2f) -> f32 {
    let mesh = mesh_at(instance);
    let material = material_at(instance);
    let vertices = triangle_vertices(mesh, triangle);
    var opacity = geometry_f32(material + 3u);
    let slot = geometry[material + 11u];
    if slot != NONE {
        opacity *= sample_slot(slot, uv_at(mesh, slot, vertices, uv), false).a;
    }
    return opacity * vertex_color(mesh, vertices, uv).a;
}

// Probability that a ray meets a triangle at a point.
fn presence_at(instance: u32, triangle: u32, uv: vec2f) -> f32 {
    if !HAS_HOLES {
        return 1.0;
    }
    let material = material_at(instance);
    let mode = geometry[material + 7u];
    if mode == ALPHA_OPAQUE {
        return 1.0;
    }
    let opacity = opacity_at(instance, triangle, uv);
    if mode == ALPHA_MASK {
        return select(0.0, 1.0, opacity >= geometry_f32(material + 8u));
    }
    return clamp(opacity, 0.0, 1.0);
}

// Whether a triangle stops this ray: masked texels by their cutoff, blended ones with the
// probability of their opacity, decided by a hash of ray and triangle.
fn stops(ray: Ray, instance: u32, triangle: u32, uv: vec2f) -> bool {
    let presence = presence_at(instance, triangle, uv);
    if presence <= 0.0 || presence >= 1.0 {
        return presence > 0.0;
    }
    var hash = 0x2545f491u;
    let origin = bitcast<vec3u>(ray.origin);
    let direction = bitcast<vec3u>(ray.direction);
    hash = hash_u32(hash_u32(hash_u32(hash ^ origin.x) ^ origin.y) ^ origin.z);
    hash = hash_u32(hash_u32(hash_u32(hash ^ direction.x) ^ direction.y) ^ direction.z);
    hash = hash_u32(hash_u32(hash ^ instance) ^ triangle);
    return unit_f32(hash) < presence;
}

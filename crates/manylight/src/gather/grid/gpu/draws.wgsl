// The random numbers of a shadow ray; twin of the numbers in sample.rs.
import package::math::sequence;

// Index of a ray among all of the picture.
fn ray_index(p: vec2u, ray: u32) -> u32 {
    return morton_2d(p.x, p.y) * params.rays + ray;
}

// One number for the grid light, one for the virtual light in it.
fn draw_numbers(p: vec2u, ray: u32) -> vec2f {
    let index = ray_index(p, ray);
    if has_flag(STRATIFIED) {
        var sequence = new_sequence(params.seed, index);
        return next_2d(&sequence);
    }
    let word = index * 2u;
    return vec2f(
        unit_f32(hash_u32(params.seed ^ hash_u32(word))),
        unit_f32(hash_u32(params.seed ^ hash_u32(word | 1u))),
    );
}

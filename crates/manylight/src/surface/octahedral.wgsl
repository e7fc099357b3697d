// Unit vectors in two times 16 bits; twins of pack_octahedral and unpack_octahedral.

fn pack_octahedral(n: vec3f) -> u32 {
    let scale = 1.0 / max(abs(n.x) + abs(n.y) + abs(n.z), 1e-30);
    var p = n.xy * scale;
    if n.z < 0.0 {
        let negative = (bitcast<vec2u>(p) >> vec2u(31u)) == vec2u(1u);
        p = (vec2f(1.0) - abs(p.yx)) * select(vec2f(1.0), vec2f(-1.0), negative);
    }
    let code = vec2u(vec2i(floor(clamp(p, vec2f(-1.0), vec2f(1.0)) * 32767.0 + 0.5)));
    return (code.x & 0xffffu) | (code.y << 16u);
}

fn unpack_octahedral(bits: u32) -> vec3f {
    let code = vec2f(vec2i(i32(bits << 16u) >> 16u, i32(bits) >> 16u));
    let p = max(code / 32767.0, vec2f(-1.0));
    let z = 1.0 - abs(p.x) - abs(p.y);
    let fold = max(-z, 0.0);
    return normalize(vec3f(p + select(vec2f(fold), vec2f(-fold), p >= vec2f(0.0)), z));
}

// What lights share to the corners of their level-1 cells; twin of share_of_points.

fn share_of_point(point: vec4f) -> array<f32, 8> {
    let f = fract(point.xyz);
    var share: array<f32, 8>;
    for (var c = 0u; c < 8u; c++) {
        let upper = vec3u(c, c >> 1u, c >> 2u) & vec3u(1u);
        let weight = select(vec3f(1.0) - f, f, upper == vec3u(1u));
        share[c] = point.w * (weight.x * weight.y * weight.z);
    }
    return share;
}

// Radiance that a Lambertian surface reflects per irradiance.
fn brdf(albedo: vec3f) -> vec3f {
    return albedo * INVERSE_PI;
}

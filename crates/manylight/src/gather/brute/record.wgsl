// What all lights together give one receiver; described in gpu.rs.
struct BruteSum {
    unshadowed: vec3f,
    evals: u32,
    shadowed: vec3f,
}

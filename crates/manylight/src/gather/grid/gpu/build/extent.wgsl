// The cube around all lights that take part, and their number; minima and maxima of numbers as
// words that sort like them.
import package::gpu::ordered;
import package::math::color;
import package::vlight::vpl::record;

// Low corner, high corner, number of lights.
struct Extent {
    low: array<atomic<u32>, 3>,
    high: array<atomic<u32>, 3>,
    count: atomic<u32>,
}

// Whether a light takes part.
fn is_valid(light: Vpl) -> bool {
    return is_finite(light.position) && is_finite(light.normal) && is_finite(light.intensity)
        && luminance(light.intensity) > 0.0;
}

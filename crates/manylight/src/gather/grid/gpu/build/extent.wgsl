// The cube around all lights that take part, and their number; minima and maxima of numbers as
// words that sort like them.
import package::math::color;
import package::vlight::vpl::record;

// Low corner, high corner, number of lights.
struct Extent {
    low: array<atomic<u32>, 3>,
    high: array<atomic<u32>, 3>,
    count: atomic<u32>,
}

// A word that sorts as the number does.
fn ordered(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    return select(bits | 0x80000000u, ~bits, (bits >> 31u) == 1u);
}

fn from_ordered(word: u32) -> f32 {
    return bitcast<f32>(select(~word, word & 0x7fffffffu, (word >> 31u) == 1u));
}

// Whether a light takes part.
fn is_valid(light: Vpl) -> bool {
    return is_finite(light.position) && is_finite(light.normal) && is_finite(light.intensity)
        && luminance(light.intensity) > 0.0;
}

// Words of the sources; described in gpu.rs.

import package::world::scene;

// 2^24: what random numbers are multiples of.
const DRAWS = 16777216.0;

fn source_f32(at: u32) -> f32 {
    return bitcast<f32>(sources[at]);
}

fn source_vec3(at: u32) -> vec3f {
    return bitcast<vec3f>(vec3u(sources[at], sources[at + 1u], sources[at + 2u]));
}

// A random number as a share of 2^32.
fn draw_of(u: f32) -> u32 {
    return min(u32(u * DRAWS), u32(DRAWS) - 1u) << 8u;
}

// Draws an index from a table of `count` thresholds; `count` where every weight is zero; twin of
// Discrete::sample.
fn draw_source(table: u32, count: u32, u: f32) -> u32 {
    let draw = draw_of(u);
    var low = 0u;
    var high = count;
    // At most 32 halvings.
    for (var i = 0u; i < 32u && low < high; i++) {
        let middle = low + (high - low) / 2u;
        if sources[table + middle] <= draw {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Probability of an index.
fn source_pmf(table: u32, count: u32, index: u32) -> f32 {
    return source_f32(table + count + index);
}

// Picks the receivers that are asked for their number of lights; twin of the picks in reach.rs.
import package::gather::grid::gpu::reach;

struct AskParams {
    pixels: u32,
    runs: u32,
}

@group(0) @binding(0) var<uniform> params: AskParams;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
@group(0) @binding(3) var<storage, read> runs: array<u32>;
// Upper and lower word of each fraction.
@group(0) @binding(4) var<storage, read> shares: array<vec2u>;
@group(0) @binding(5) var<storage, read_write> asked: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> reach: array<Reach>;

// Upper and lower word of a product.
fn multiply(a: u32, b: u32) -> vec2u {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let middle = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let other = (a & 0xffffu) * (b >> 16u) + (middle & 0xffffu);
    let high = (a >> 16u) * (b >> 16u) + (middle >> 16u) + (other >> 16u);
    return vec2u(high, (other << 16u) | (low & 0xffffu));
}

// Whole part of a fraction of a number.
fn part_of(fraction: vec2u, count: u32) -> u32 {
    let product = multiply(fraction.x, count);
    let rest = multiply(fraction.y, count).x;
    return product.x + select(0u, 1u, product.y + rest < rest);
}

// The pixel of a receiver, by its number among all of them.
fn find_pixel(wanted: u32) -> u32 {
    // Last run that begins at or below it.
    var low = 0u;
    var high = params.runs;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        let is_behind = runs[middle] <= wanted;
        low = select(low, middle, is_behind);
        high = select(middle, high, is_behind);
    }
    var left = wanted - runs[low];
    for (var i = 0u; i < RUN; i++) {
        let pixel = low * RUN + i;
        if pixel < params.pixels && positions[pixel].w < NO_SURFACE {
            if left == 0u {
                return pixel;
            }
            left -= 1u;
        }
    }
    return 0u;
}

@compute @workgroup_size(GROUP_X)
fn main(@builtin(local_invocation_index) local: u32) {
    let count = runs[params.runs];
    if local == 0u {
        reach[0].asked = select(0u, ASKED, count > 0u);
    }
    if count > 0u {
        let pixel = find_pixel(part_of(shares[local], count));
        asked[local] = positions[pixel];
        asked[ASKED + local] = normals[pixel];
    }
}

// The first pass over two signals, weighted by trust and by the guess; twin of first_pass.

import package::filter::kept;
import package::filter::taps;
import package::filter::noisy;

@group(0) @binding(0) var<uniform> params: NoisyParams;
@group(0) @binding(1) var<storage, read> guide_positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> guide_normals: array<KeptNormal>;
// Share and trust.
@group(0) @binding(3) var<storage, read> first: array<vec2f>;
@group(0) @binding(4) var<storage, read> second: array<vec2f>;
// Frames behind each of them, or one number for all.
@group(0) @binding(5) var<storage, read> first_frames: array<f32>;
@group(0) @binding(6) var<storage, read> second_frames: array<f32>;
// Mean and variance of each signal in turn.
@group(0) @binding(7) var<storage, read> guess: array<KeptPair>;
@group(0) @binding(8) var<storage, read_write> filtered: array<KeptPair>;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= params.size) {
        return;
    }
    let index = pixel.y * params.size.x + pixel.x;
    let guide_position = guide_positions[index];
    let here = plane_of(guide_position, normal_of(guide_normals[index]), 1.0);
    let guess_here = pair_of(guess[index]);
    let noise_here = RATIO_SLACK * RATIO_SLACK * guess_here.yw + LEAST_NOISE;
    let noisy = vec4f(first[index], second[index]);
    let variance = variance_at(index, guess_here);
    var weight = KERNEL_CENTER * KERNEL_CENTER * trust_of(noisy);
    weight = select(vec2f(0.0), weight, guide_position.w > 0.0);
    var sums = Sums(weight * noisy.xz, weight * weight * variance, weight);
    for (var tap = 0u; tap < 9u; tap++) {
        let other = tap_index(pixel.xy, tap, 1u, params.size);
        if tap == 4u || other < 0 {
            continue;
        }
        let there = u32(other);
        let normal_there = normal_of(guide_normals[there]);
        let edge = weigh(here, guide_positions[there], normal_there, tap_kernel(tap));
        let guess_there = pair_of(guess[there]);
        let noisy_there = vec4f(first[there], second[there]);
        let change = guess_here.xz - guess_there.xz;
        let noise = noise_here + RATIO_SLACK * RATIO_SLACK * guess_there.yw;
        let similar = edge.x * noise / (edge.y * noise + change * change);
        let variance_there = variance_at(there, guess_there);
        add_tap(&sums, similar * trust_of(noisy_there), noisy_there.xz, variance_there);
    }
    let found = means(sums, vec4f(noisy.x, variance.x, noisy.z, variance.y));
    filtered[index] = keep_pair(found);
}

fn variance_at(index: u32, guess_there: vec4f) -> vec2f {
    let frames = vec2f(
        first_frames[min(index, arrayLength(&first_frames) - 1u)],
        second_frames[min(index, arrayLength(&second_frames) - 1u)],
    );
    return variance_of(guess_there.xz, frames, params.rays);
}

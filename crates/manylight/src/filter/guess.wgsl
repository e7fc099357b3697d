// Means of two signals over nearby surfaces, blind to changes of the signals themselves: the first
// guess that tells their variance; twin of Tap::add_blind and of first_pass.

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
@group(0) @binding(7) var<storage, read_write> guess: array<KeptPair>;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= params.size) {
        return;
    }
    let index = pixel.y * params.size.x + pixel.x;
    let guide_position = guide_positions[index];
    let here = plane_of(guide_position, normal_of(guide_normals[index]), 1.0);
    let noisy = vec4f(first[index], second[index]);
    var weight = KERNEL_CENTER * KERNEL_CENTER * trust_of(noisy);
    weight = select(vec2f(0.0), weight, guide_position.w > 0.0);
    var sums = Sums(weight * noisy.xz, weight * weight, weight);
    for (var tap = 0u; tap < 9u; tap++) {
        let other = tap_index(pixel.xy, tap, 1u, params.size);
        if tap == 4u || other < 0 {
            continue;
        }
        let there = u32(other);
        let normal_there = normal_of(guide_normals[there]);
        let edge = weigh(here, guide_positions[there], normal_there, tap_kernel(tap));
        let noisy_there = vec4f(first[there], second[there]);
        let weight_there = edge.x / edge.y * trust_of(noisy_there);
        add_tap(&sums, weight_there, noisy_there.xz, vec2f(1.0));
    }
    let mean = means(sums, vec4f(noisy.x, 1.0, noisy.z, 1.0));
    let frames = vec2f(
        first_frames[min(index, arrayLength(&first_frames) - 1u)],
        second_frames[min(index, arrayLength(&second_frames) - 1u)],
    );
    let variance = mean.yw * variance_of(mean.xz, frames, params.rays);
    guess[index] = keep_pair(vec4f(mean.x, variance.x, mean.z, variance.y));
}

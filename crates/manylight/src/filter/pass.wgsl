// One pass after the first over two signals; twin of Tap::add.

import package::filter::kept;
import package::filter::taps;

struct PassParams {
    size: vec2u,
    // Receivers from one tap to the next.
    step: u32,
}

@group(0) @binding(0) var<uniform> params: PassParams;
@group(0) @binding(1) var<storage, read> guide_positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> guide_normals: array<KeptNormal>;
// Mean and variance of each signal in turn.
@group(0) @binding(3) var<storage, read> signals: array<KeptPair>;
@group(0) @binding(4) var<storage, read_write> filtered: array<KeptPair>;

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= params.size) {
        return;
    }
    let index = pixel.y * params.size.x + pixel.x;
    let guide_position = guide_positions[index];
    let here = plane_of(guide_position, normal_of(guide_normals[index]), 1.0 / f32(params.step));
    let signal = pair_of(signals[index]);
    let noise_here = RATIO_SLACK * RATIO_SLACK * signal.yw + LEAST_NOISE;
    let weight = select(0.0, KERNEL_CENTER * KERNEL_CENTER, guide_position.w > 0.0);
    var sums = Sums(weight * signal.xz, weight * weight * signal.yw, vec2f(weight));
    for (var tap = 0u; tap < 9u; tap++) {
        let other = tap_index(pixel.xy, tap, params.step, params.size);
        if tap == 4u || other < 0 {
            continue;
        }
        let there = u32(other);
        let normal_there = normal_of(guide_normals[there]);
        let edge = weigh(here, guide_positions[there], normal_there, tap_kernel(tap));
        let signal_there = pair_of(signals[there]);
        let change = signal.xz - signal_there.xz;
        let noise = noise_here + RATIO_SLACK * RATIO_SLACK * signal_there.yw;
        let similar = edge.x * noise / (edge.y * noise + change * change);
        add_tap(&sums, similar, signal_there.xz, signal_there.yw);
    }
    filtered[index] = keep_pair(means(sums, signal));
}

// Adds a frame of one signal to those before it; twin of accumulate.

import package::math::color;
import package::filter::kept;
import package::filter::taps;

struct AccumulateParams {
    size: vec2u,
    // Rays behind a share in one frame.
    rays: f32,
    // Most frames that count.
    most: f32,
}

@group(0) @binding(0) var<uniform> params: AccumulateParams;
@group(0) @binding(1) var<storage, read> guide_positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> guide_normals: array<KeptNormal>;
// Corner of the taps and bits of the weights of three; the sum of four is 1.
@group(0) @binding(3) var<storage, read> motion: array<vec4u>;
// Share and trust of this frame, of those before it, and of both.
@group(0) @binding(4) var<storage, read> noisy: array<vec2f>;
@group(0) @binding(5) var<storage, read> last_shares: array<vec2f>;
@group(0) @binding(6) var<storage, read> last_frames: array<f32>;
@group(0) @binding(7) var<storage, read_write> shares: array<vec2f>;
@group(0) @binding(8) var<storage, read_write> frames: array<f32>;

// A share of rays over several frames.
struct Share {
    ratio: f32,
    trust: f32,
    frames: f32,
}

// What shares around a receiver say: their mean, and how far from it history may be.
struct Neighborhood {
    mean: f32,
    slack: f32,
}

@compute @workgroup_size(GROUP_X, GROUP_Y)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= params.size) {
        return;
    }
    let index = pixel.y * params.size.x + pixel.x;
    let here = noisy[index];
    var share = Share(here.x, max(here.y, LEAST_TRUST), 1.0);
    let taps = motion[index];
    if taps.x != NO_TAPS {
        let history = rectify(recall(taps), neighborhood(pixel.xy, index));
        // What is no number is forgotten, or it would stay.
        if is_finite(vec3f(history.ratio, history.trust, 0.0)) {
            share = blend(share, history);
        }
    }
    shares[index] = vec2f(share.ratio, share.trust);
    frames[index] = share.frames;
}

// The mean of the signal at the taps, in proportion to trust.
fn recall(taps: vec4u) -> Share {
    let corner = vec2i(i32(taps.x & 0xffffu), i32(taps.x >> 16u)) - 1;
    let three = bitcast<vec3f>(taps.yzw);
    let weights = vec4f(three, 1.0 - three.x - three.y - three.z);
    var sum = Share(0.0, 0.0, 0.0);
    for (var tap = 0; tap < 4; tap++) {
        let at = corner + vec2i(tap % 2, tap / 2);
        // What lies outside weighs nothing but a rounding error.
        if any(at < vec2i(0)) || any(at >= vec2i(params.size)) {
            continue;
        }
        let there = at.y * i32(params.size.x) + at.x;
        let share = last_shares[there];
        let weight = max(weights[tap], 0.0);
        sum.ratio += weight * share.y * share.x;
        sum.trust += weight * share.y;
        sum.frames += weight * last_frames[there];
    }
    // Without trust the ratio counts for nothing.
    sum.ratio /= max(sum.trust, 1e-30);
    return sum;
}

// Mean, mean square and sum of squared weights of the shares around a receiver; twin of
// neighborhoods and of Neighborhood::new.
fn neighborhood(pixel: vec2u, index: u32) -> Neighborhood {
    let here = plane_of(guide_positions[index], normal_of(guide_normals[index]), 1.0);
    let center = noisy[index];
    let own = KERNEL_CENTER * KERNEL_CENTER * max(center.y, LEAST_TRUST);
    var sums = Sums(own * vec2f(center.x, center.x * center.x), vec2f(own * own), vec2f(own));
    for (var tap = 0u; tap < 9u; tap++) {
        let other = tap_index(pixel, tap, 1u, params.size);
        if tap == 4u || other < 0 {
            continue;
        }
        let there = u32(other);
        let normal_there = normal_of(guide_normals[there]);
        let edge = weigh(here, guide_positions[there], normal_there, tap_kernel(tap));
        let share = noisy[there];
        let weight = edge.x / edge.y * max(share.y, LEAST_TRUST);
        add_tap(&sums, vec2f(weight), vec2f(share.x, share.x * share.x), vec2f(1.0));
    }
    let mean = sums.value / sums.total;
    let weights_sq = sums.variance.x / (sums.total.x * sums.total.x);
    let count = params.rays / weights_sq;
    let p = (mean.x * count + 1.0) / (count + 2.0);
    let variance = max(mean.y - mean.x * mean.x, p * (1.0 - p) / params.rays);
    return Neighborhood(mean.x, CLAMP * sqrt(max(variance, 0.0)));
}

// Clamps history to what is possible now; the further it was away the fewer frames it counts.
fn rectify(history: Share, around: Neighborhood) -> Share {
    let change = history.ratio - around.mean;
    if abs(change) <= around.slack {
        return history;
    }
    let share = around.slack / abs(change);
    let frames = max(history.frames * share * share, 1.0);
    return Share(around.mean + change * share, history.trust, frames);
}

// Adds a frame to history: every frame weighs the same up to the most, then the oldest fade.
fn blend(now: Share, history: Share) -> Share {
    let before = min(history.frames, params.most - 1.0);
    let total = history.trust * before + now.trust;
    let ratio = (history.ratio * history.trust * before + now.ratio * now.trust) / total;
    return Share(ratio, total / (before + 1.0), before + 1.0);
}

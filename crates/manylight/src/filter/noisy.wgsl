// Shares of a few rays, two signals at once.

struct NoisyParams {
    size: vec2u,
    // Rays behind a share of either signal, in one frame.
    rays: vec2f,
}

// What the shares count, of share and trust of each signal in turn.
fn trust_of(noisy: vec4f) -> vec2f {
    return max(noisy.yw, vec2f(LEAST_TRUST));
}

// Variance of shares whose expectation is `mean`, of some rays in each of some frames.
fn variance_of(mean: vec2f, frames: vec2f, rays: vec2f) -> vec2f {
    return max(mean * (1.0 - mean), vec2f(LEAST_VARIANCE)) * (1.0 / (rays * frames));
}

// How the filter keeps what its passes read many times: in numbers of 16 bits.
enable f16;

const MOST_HALF = 65504.0;

// Unit geometric normal, zero where there is no surface; luminance of the albedo.
alias KeptNormal = vec4<f16>;
// Mean and standard deviation of two signals: variances have more orders of magnitude than such
// numbers.
alias KeptPair = vec4<f16>;

fn keep_normal(normal: vec4f) -> KeptNormal {
    return KeptNormal(clamp(normal, vec4f(-MOST_HALF), vec4f(MOST_HALF)));
}

fn normal_of(kept: KeptNormal) -> vec4f {
    return vec4f(kept);
}

fn keep_pair(pair: vec4f) -> KeptPair {
    let bounded = vec4f(pair.x, sqrt(pair.y), pair.z, sqrt(pair.w));
    return KeptPair(clamp(bounded, vec4f(-MOST_HALF), vec4f(MOST_HALF)));
}

fn pair_of(kept: KeptPair) -> vec4f {
    let pair = vec4f(kept);
    return vec4f(pair.x, pair.y * pair.y, pair.z, pair.w * pair.w);
}

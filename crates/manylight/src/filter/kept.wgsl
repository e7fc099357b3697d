// How the filter keeps what its passes read many times.

// Unit geometric normal, zero where there is no surface; luminance of the albedo.
alias KeptNormal = vec4f;
// Mean and variance of two signals.
alias KeptPair = vec4f;

fn keep_normal(normal: vec4f) -> KeptNormal {
    return normal;
}

fn normal_of(kept: KeptNormal) -> vec4f {
    return kept;
}

fn keep_pair(pair: vec4f) -> KeptPair {
    return pair;
}

fn pair_of(kept: KeptPair) -> vec4f {
    return kept;
}

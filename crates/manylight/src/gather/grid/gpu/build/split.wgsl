// Where sorted keys part.

// The number of levels at which two neighbors in the order lie in different cells of level 1 for
// the first time.
fn split_level(a: vec2u, b: vec2u) -> u32 {
    let different = a ^ b;
    if all(different == vec2u(0u)) {
        return NEVER;
    }
    let high = 32u + firstLeadingBit(different.y);
    let bit = select(firstLeadingBit(different.x), high, different.y != 0u);
    return MAX_LEVELS - bit / 3u;
}

// One pass of sorting items with a key of 64 bits, low word first, in x and y.

struct SortParams {
    // Items that there is room for.
    capacity: u32,
    // Blocks of them.
    blocks: u32,
    // Lowest bit of the digit.
    shift: u32,
}

fn digit_of(item: vec4u) -> u32 {
    let word = select(item.x, item.y, params.shift >= 32u);
    return (word >> (params.shift & 31u)) & (SORT_DIGITS - 1u);
}

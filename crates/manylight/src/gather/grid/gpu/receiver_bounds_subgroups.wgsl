// Bounds of the receivers that a workgroup looks at, by subgroups.
import package::gpu::ordered;
import package::gather::grid::gpu::bounds_of;

// Maxima of words, as all twelve numbers become some: minima of their complements. They begin at
// zero, which is below the words of all numbers.
var<workgroup> bounds_words: array<atomic<u32>, 12>;
var<workgroup> joined_bounds: Bounds;

fn join_words(first: u32, low: vec3f, high: vec3f) {
    for (var axis = 0u; axis < 3u; axis++) {
        atomicMax(&bounds_words[first + axis], ~ordered(low[axis]));
        atomicMax(&bounds_words[first + 3u + axis], ordered(high[axis]));
    }
}

fn joined_word(word: u32) -> u32 {
    return atomicLoad(&bounds_words[word]);
}

fn joined_low(first: u32) -> vec3f {
    return vec3f(
        from_ordered(~joined_word(first)),
        from_ordered(~joined_word(first + 1u)),
        from_ordered(~joined_word(first + 2u)),
    );
}

fn joined_high(first: u32) -> vec3f {
    return vec3f(
        from_ordered(joined_word(first)),
        from_ordered(joined_word(first + 1u)),
        from_ordered(joined_word(first + 2u)),
    );
}

// Joins the bounds of all invocations, which must all come here, once.
fn join_all(own: Bounds, local: u32) -> Bounds {
    if local < 12u {
        atomicStore(&bounds_words[local], 0u);
    }
    // Brings subgroups together that came out of a loop one by one, too.
    workgroupBarrier();
    let joined = Bounds(
        subgroupMin(own.low),
        subgroupMax(own.high),
        subgroupMin(own.normal_low),
        subgroupMax(own.normal_high),
    );
    if subgroupExclusiveAdd(1u) == 0u {
        join_words(0u, joined.low, joined.high);
        join_words(6u, joined.normal_low, joined.normal_high);
    }
    workgroupBarrier();
    if local == 0u {
        joined_bounds = Bounds(joined_low(0u), joined_high(3u), joined_low(6u), joined_high(9u));
    }
    return workgroupUniformLoad(&joined_bounds);
}

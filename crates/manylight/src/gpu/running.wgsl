// Running sums over the invocations of a workgroup.

var<workgroup> running_sums: array<u32, GROUP_X * GROUP_Y>;
var<workgroup> running_flags: array<atomic<u32>, (GROUP_X * GROUP_Y + 31u) / 32u>;

// Where an invocation stands in the order of sums. All invocations must come here, once.
fn place_of(local: u32) -> u32 {
    return local;
}

// The sum of the values at places before this one, and of all. All invocations must come here.
fn running_sum(place: u32, value: u32) -> vec2u {
    // Others may still read what was summed up last.
    workgroupBarrier();
    running_sums[place] = value;
    for (var step = 1u; step < GROUP_X * GROUP_Y; step *= 2u) {
        workgroupBarrier();
        var before = 0u;
        if place >= step {
            before = running_sums[place - step];
        }
        workgroupBarrier();
        running_sums[place] += before;
    }
    workgroupBarrier();
    return vec2u(running_sums[place] - value, running_sums[GROUP_X * GROUP_Y - 1u]);
}

// The sum of all values of the last running_sum, the same for all invocations.
fn running_total() -> u32 {
    return workgroupUniformLoad(&running_sums[GROUP_X * GROUP_Y - 1u]);
}

// How many flags are set at places before this one, and in all. All invocations must come here.
fn running_count(place: u32, is_set: bool) -> vec2u {
    // Others may still read what was counted last.
    workgroupBarrier();
    if place < (GROUP_X * GROUP_Y + 31u) / 32u {
        atomicStore(&running_flags[place], 0u);
    }
    workgroupBarrier();
    if is_set {
        atomicOr(&running_flags[place / 32u], 1u << (place % 32u));
    }
    workgroupBarrier();
    var counts = vec2u(0u);
    for (var word = 0u; word < (GROUP_X * GROUP_Y + 31u) / 32u; word++) {
        let bits = atomicLoad(&running_flags[word]);
        let below = select(0u, (1u << (place % 32u)) - 1u, word == place / 32u);
        let before = bits & select(below, 0xffffffffu, word < place / 32u);
        counts += vec2u(countOneBits(before), countOneBits(bits));
    }
    return counts;
}

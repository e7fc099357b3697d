// Places of invocations by subgroups of any sizes.
//
// Nothing is assumed of how invocations are dealt out to subgroups: each subgroup takes the next
// places as it comes, which changes who does something but not what comes out.

// Subgroups that have come, in the upper half, and their invocations.
var<workgroup> subgroups_seated: atomic<u32>;

// The subgroup's number, its invocations, and the place of this one among them.
var<private> subgroup_number: u32;
var<private> subgroup_count: u32;
var<private> subgroup_place: u32;

// Where an invocation stands in the order of sums. All invocations must come here, once.
fn place_of(local: u32) -> u32 {
    subgroup_place = subgroupExclusiveAdd(1u);
    subgroup_count = subgroupAdd(1u);
    var first = 0u;
    if subgroup_place == 0u {
        first = atomicAdd(&subgroups_seated, 0x10000u + subgroup_count);
    }
    // It is zero for all others.
    first = subgroupAdd(first);
    subgroup_number = first >> 16u;
    return (first & 0xffffu) + subgroup_place;
}

// How many subgroups there are, after a barrier.
fn subgroups_here() -> u32 {
    return atomicLoad(&subgroups_seated) >> 16u;
}

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
    if local == 0u {
        atomicStore(&subgroups_seated, 0u);
    }
    workgroupBarrier();
    subgroup_place = subgroupExclusiveAdd(1u);
    subgroup_count = subgroupAdd(1u);
    // All come here, the others with nothing to add: after a branch that only some took, a device
    // need not bring a subgroup together again before it sums.
    let is_first = subgroup_place == 0u;
    let seated = atomicAdd(&subgroups_seated, select(0u, 0x10000u + subgroup_count, is_first));
    let first = subgroupAdd(select(0u, seated, is_first));
    subgroup_number = first >> 16u;
    return (first & 0xffffu) + subgroup_place;
}

// How many subgroups there are, after a barrier.
fn subgroups_here() -> u32 {
    return atomicLoad(&subgroups_seated) >> 16u;
}

// Running sums over the invocations of a workgroup, by subgroups.
import package::gpu::subgroup;

// By subgroup.
var<workgroup> subgroup_sums: array<u32, GROUP_X * GROUP_Y>;
var<workgroup> running_all: u32;

// The sum of the values at places before this one, and of all. All invocations must come here.
fn running_sum(place: u32, value: u32) -> vec2u {
    // Others may still read what was summed up last.
    workgroupBarrier();
    let within = subgroupExclusiveAdd(value);
    let sum = subgroupAdd(value);
    if subgroup_place == 0u {
        subgroup_sums[subgroup_number] = sum;
    }
    workgroupBarrier();
    let subgroups = subgroups_here();
    var sums = vec2u(0u);
    for (var first = 0u; first < subgroups; first += subgroup_count) {
        let i = first + subgroup_place;
        let other = select(0u, subgroup_sums[min(i, subgroups - 1u)], i < subgroups);
        sums += vec2u(select(0u, other, i < subgroup_number), other);
    }
    let all = subgroupAdd(sums.y);
    let before = within + subgroupAdd(sums.x);
    if place == 0u {
        running_all = all;
    }
    return vec2u(before, all);
}

// The sum of all values of the last running_sum, the same for all invocations.
fn running_total() -> u32 {
    return workgroupUniformLoad(&running_all);
}

// How many flags are set at places before this one, and in all. All invocations must come here.
fn running_count(place: u32, is_set: bool) -> vec2u {
    return running_sum(place, select(0u, 1u, is_set));
}

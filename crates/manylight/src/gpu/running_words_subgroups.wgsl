// Running sums over the invocations of a workgroup, RUNNING_WORDS at a time, by subgroups.
import package::gpu::subgroup;

struct RunningWords {
    // Sums of the words at places before.
    before: array<u32, RUNNING_WORDS>,
    // Sums of all words.
    all: array<u32, RUNNING_WORDS>,
}

// By subgroup.
var<workgroup> subgroup_words: array<array<u32, GROUP_X>, RUNNING_WORDS>;

// All invocations must come here.
fn sum_words(place: u32, words: array<u32, RUNNING_WORDS>) -> RunningWords {
    var own = words;
    var sums: RunningWords;
    // Others may still read what was summed up last.
    workgroupBarrier();
    for (var w = 0u; w < RUNNING_WORDS; w++) {
        sums.before[w] = subgroupExclusiveAdd(own[w]);
        sums.all[w] = subgroupAdd(own[w]);
    }
    if subgroup_place == 0u {
        for (var w = 0u; w < RUNNING_WORDS; w++) {
            subgroup_words[w][subgroup_number] = sums.all[w];
        }
    }
    workgroupBarrier();
    let subgroups = subgroups_here();
    for (var w = 0u; w < RUNNING_WORDS; w++) {
        var others = vec2u(0u);
        for (var first = 0u; first < subgroups; first += subgroup_count) {
            let i = first + subgroup_place;
            let other = select(0u, subgroup_words[w][min(i, subgroups - 1u)], i < subgroups);
            others += vec2u(select(0u, other, i < subgroup_number), other);
        }
        sums.before[w] += subgroupAdd(others.x);
        sums.all[w] = subgroupAdd(others.y);
    }
    return sums;
}

// Running sums over the invocations of a workgroup, RUNNING_WORDS at a time.

struct RunningWords {
    // Sums of the words at places before.
    before: array<u32, RUNNING_WORDS>,
    // Sums of all words.
    all: array<u32, RUNNING_WORDS>,
}

var<workgroup> running_words: array<array<u32, GROUP_X>, RUNNING_WORDS>;

// Where an invocation stands in the order of sums. All invocations must come here, once.
fn place_of(local: u32) -> u32 {
    return local;
}

// All invocations must come here.
fn sum_words(place: u32, words: array<u32, RUNNING_WORDS>) -> RunningWords {
    var own = words;
    // Others may still read what was summed up last.
    workgroupBarrier();
    for (var w = 0u; w < RUNNING_WORDS; w++) {
        running_words[w][place] = own[w];
    }
    for (var step = 1u; step < GROUP_X; step *= 2u) {
        workgroupBarrier();
        var before: array<u32, RUNNING_WORDS>;
        for (var w = 0u; w < RUNNING_WORDS; w++) {
            before[w] = 0u;
            if place >= step {
                before[w] = running_words[w][place - step];
            }
        }
        workgroupBarrier();
        for (var w = 0u; w < RUNNING_WORDS; w++) {
            running_words[w][place] += before[w];
        }
    }
    workgroupBarrier();
    var sums: RunningWords;
    for (var w = 0u; w < RUNNING_WORDS; w++) {
        sums.before[w] = running_words[w][place] - own[w];
        sums.all[w] = running_words[w][GROUP_X - 1u];
    }
    return sums;
}

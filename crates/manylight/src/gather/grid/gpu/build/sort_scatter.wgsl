// Moves every item to its place by one digit; equal digits keep their order.
//
// A block is first sorted in workgroup memory, half a digit at a time, so that items with equal
// digits are written side by side.
import package::gpu::running_words;
import package::gather::grid::gpu::build::digit;

@group(0) @binding(0) var<uniform> params: SortParams;
@group(0) @binding(1) var<storage, read> count: array<u32>;
@group(0) @binding(2) var<storage, read> items: array<vec4u>;
@group(0) @binding(3) var<storage, read> places: array<u32>;
@group(0) @binding(4) var<storage, read_write> sorted: array<vec4u>;

const PER_INVOCATION = SORT_BLOCK / GROUP_X;
const HALF_BITS = 4u;
const HALF_DIGITS = 16u;
// How many items have each half digit, two to a word.
const RUNNING_WORDS = 8u;
// Digit above the position in the block; all ones for what lies behind the end.
var<workgroup> order: array<u32, SORT_BLOCK>;
// First item of the block with each digit.
var<workgroup> starts: array<u32, SORT_DIGITS>;

// One stable pass of the block over half a digit.
fn sort_half(place: u32, shift: u32) {
    var own: array<u32, PER_INVOCATION>;
    var counts: array<u32, RUNNING_WORDS>;
    for (var i = 0u; i < PER_INVOCATION; i++) {
        own[i] = order[place * PER_INVOCATION + i];
        let half = (own[i] >> (16u + shift)) & (HALF_DIGITS - 1u);
        counts[half >> 1u] += 1u << ((half & 1u) * 16u);
    }
    var sums = sum_words(place, counts);
    // Where the first item of this invocation with each half digit goes.
    var next: array<u32, HALF_DIGITS>;
    var before = 0u;
    for (var half = 0u; half < HALF_DIGITS; half++) {
        let lane = (half & 1u) * 16u;
        let w = half >> 1u;
        next[half] = before + ((sums.before[w] >> lane) & 0xffffu);
        before += (sums.all[w] >> lane) & 0xffffu;
    }
    for (var i = 0u; i < PER_INVOCATION; i++) {
        let half = (own[i] >> (16u + shift)) & (HALF_DIGITS - 1u);
        order[next[half]] = own[i];
        next[half]++;
    }
    workgroupBarrier();
}

@compute @workgroup_size(GROUP_X)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) local: u32,
) {
    let first = group.x * SORT_BLOCK;
    let end = min(count[0], params.capacity);
    let here = min(max(end, first) - first, SORT_BLOCK);
    for (var i = 0u; i < PER_INVOCATION; i++) {
        let position = i * GROUP_X + local;
        var entry = 0xffff0000u | position;
        if position < here {
            entry = (digit_of(items[first + position]) << 16u) | position;
        }
        order[position] = entry;
    }
    workgroupBarrier();
    let place = place_of(local);
    sort_half(place, 0u);
    sort_half(place, HALF_BITS);
    for (var i = 0u; i < PER_INVOCATION; i++) {
        let position = i * GROUP_X + local;
        let digit = order[position] >> 16u;
        if position < here && (position == 0u || (order[max(position, 1u) - 1u] >> 16u) != digit) {
            starts[digit] = position;
        }
    }
    workgroupBarrier();
    for (var i = 0u; i < PER_INVOCATION; i++) {
        let position = i * GROUP_X + local;
        if position < here {
            let digit = order[position] >> 16u;
            let place = places[digit * params.blocks + group.x] + position - starts[digit];
            sorted[place] = items[first + (order[position] & 0xffffu)];
        }
    }
}

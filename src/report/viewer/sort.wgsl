// One of four passes of a stable radix sort; each sorts by eight bits of the key: count, scan, scatter.
//
// A workgroup handles a block of pairs. An invocation handles one digit in steps that work by digit. The
// result does not depend on the order of invocations, so it is always the same.
// pairs, turn -> sorted
override BLOCK: u32; // pairs for each workgroup, a multiple of DIGITS

const DIGITS = 256u;
const MASKS = DIGITS / 32; // words with a bit for each invocation

struct Turn {
    shift: u32,
    count: u32, // pairs
    blocks: u32,
}

@group(0) @binding(0) var<uniform> turn: Turn;
@group(0) @binding(1) var<storage, read> pairs: array<vec2u>; // key, value
@group(0) @binding(2) var<storage, read_write> sorted: array<vec2u>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>; // by digit and block, then the sum over earlier blocks
@group(0) @binding(4) var<storage, read_write> totals: array<u32>; // by digit

var<workgroup> tally: array<atomic<u32>, DIGITS>;
var<workgroup> sums: array<u32, DIGITS>;
var<workgroup> next: array<u32, DIGITS>; // next position of each digit
var<workgroup> holders: array<atomic<u32>, MASKS * DIGITS>; // invocations that have a pair of a digit, as bits

fn digit_of(pair: vec2u) -> u32 { return (pair.x >> turn.shift) & (DIGITS - 1); }

@compute @workgroup_size(DIGITS)
fn count(@builtin(workgroup_id) block: vec3u, @builtin(local_invocation_index) lane: u32) {
    let end = min((block.x + 1) * BLOCK, turn.count);
    for (var at = block.x * BLOCK + lane; at < end; at += DIGITS) {
        atomicAdd(&tally[digit_of(pairs[at])], 1u);
    }
    workgroupBarrier();
    counts[lane * turn.blocks + block.x] = atomicLoad(&tally[lane]);
}

// Inclusive sum of the values of all invocations up to this one. Afterwards `sums` has all of them.
fn running_sum(lane: u32, value: u32) -> u32 {
    workgroupBarrier();
    sums[lane] = value;
    workgroupBarrier();
    for (var reach = 1u; reach < DIGITS; reach *= 2) {
        var left = 0u;
        if (lane >= reach) { left = sums[lane - reach]; }
        workgroupBarrier();
        sums[lane] += left;
        workgroupBarrier();
    }
    return sums[lane];
}

// A workgroup handles one digit.
@compute @workgroup_size(DIGITS)
fn scan(@builtin(workgroup_id) digit: vec3u, @builtin(local_invocation_index) lane: u32) {
    var before = 0u;
    for (var start = 0u; start < turn.blocks; start += DIGITS) {
        let block = start + lane;
        let at = digit.x * turn.blocks + block;
        var own = 0u;
        if (block < turn.blocks) { own = counts[at]; }
        let sum = running_sum(lane, own);
        if (block < turn.blocks) { counts[at] = before + sum - own; }
        before += sums[DIGITS - 1];
    }
    if (lane == 0) { totals[digit.x] = before; }
}

@compute @workgroup_size(DIGITS)
fn scatter(@builtin(workgroup_id) block: vec3u, @builtin(local_invocation_index) lane: u32) {
    let total = totals[lane];
    next[lane] = running_sum(lane, total) - total + counts[lane * turn.blocks + block.x];
    let word = (lane / 32) * DIGITS;
    let bit = 1u << (lane % 32);
    for (var start = 0u; start < BLOCK; start += DIGITS) {
        let at = block.x * BLOCK + start + lane;
        var pair = vec2u(0);
        if (at < turn.count) {
            pair = pairs[at];
            atomicOr(&holders[word + digit_of(pair)], bit);
        }
        workgroupBarrier();
        if (at < turn.count) {
            let digit = digit_of(pair);
            var to = next[digit] + countOneBits(atomicLoad(&holders[word + digit]) & (bit - 1));
            for (var w = digit; w < word; w += DIGITS) { to += countOneBits(atomicLoad(&holders[w])); }
            sorted[to] = pair;
        }
        workgroupBarrier();
        for (var w = lane; w < MASKS * DIGITS; w += DIGITS) { next[lane] += countOneBits(atomicExchange(&holders[w], 0u)); }
        workgroupBarrier();
    }
}

#version 460
// Last of three kernels of a radix sort pass: moves every pair to its place, pairs of equal digit in their
// old order.
//
// A subgroup scatters one block of BLOCK pairs, row by row; the rank within a row comes from the lanes that
// have the same digit. keys_in, values_in, block_counts, digit_totals -> keys_out, values_out.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/radix.glsl"
#include "../shared/meet.glsl"

// Keys of 0xFFFFFFFF are dropped, and the number of remaining keys goes to count[kept_index].
layout(constant_id = 3) const bool COMPACT = false;
// Number of lanes of a subgroup if small and known, so that lane indices are constants: a CPU then broadcasts
// a value in one instruction, while a ballot goes through all lanes. 0: use ballots, one for each bit of a
// digit.
layout(constant_id = 4) const uint LANES = 0;
// The value of a key is its index; values_in is not read.
layout(constant_id = 5) const bool INDEXED = false;
// See radix_upsweep.
layout(constant_id = 6) const uint ROW_LANES = 8;

layout(set = 0, binding = 0, scalar) buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer KeysIn { uint keys_in[]; };
layout(set = 0, binding = 2, scalar) readonly buffer ValuesIn { uint values_in[]; };
layout(set = 0, binding = 3, scalar) readonly buffer BlockCounts { uint block_counts[]; };
layout(set = 0, binding = 4, scalar) readonly buffer DigitTotals { uint digit_totals[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer KeysOut { uint keys_out[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer ValuesOut { uint values_out[]; };

// Indices in count of the number of keys and of the number kept (not the same); lowest bit of the digit.
layout(push_constant, scalar) uniform Push { uint count_index; uint kept_index; uint shift; } push;

// Place of the next pair of each digit. A row per subgroup, as in radix_upsweep.
shared uint next_place[(gl_WorkGroupSize.x / ROW_LANES) * DIGITS];

// The live lanes whose digit is this lane's, if it is live.
uvec2 same_digit(uint digit, bool live) {
    uvec2 peers = uvec2(0);
    if (LANES > 0) {
        uint shown = live ? digit : DIGITS;
        [[unroll]] for (uint lane = 0; lane < LANES; ++lane) peers.x |= uint(subgroupShuffle(shown, lane) == shown) << lane;
        return peers;
    }
    peers = subgroupBallot(live).xy;
    for (uint bit = 0; bit < DIGIT_BITS; bit++) {
        bool one = (digit >> bit & 1u) != 0;
        uvec2 ones = subgroupBallot(one).xy;
        peers &= one ? ones : ~ones;
    }
    return peers;
}

// True if no lane of these is after this one.
bool highest(uvec2 lanes) {
    uvec2 later = lanes & gl_SubgroupGtMask.xy;
    return (later.x | later.y) == 0;
}

void main() {
    uint keys = count[push.count_index];
    uint block = subgroup_index();
    // A compacting pass over no keys must still report that none is left.
    if (!(block < blocks_for(keys) || (COMPACT && block == 0))) return; // guard: blocks of no keys
    uint lane = gl_SubgroupInvocationID;
    uint own = gl_SubgroupID * DIGITS;

    uint smaller = 0;
    for (uint first = 0; first < DIGITS; first += gl_SubgroupSize) {
        uint digit = first + lane;
        uint total = digit < DIGITS ? digit_totals[digit] : 0;
        uint upto = smaller + subgroupInclusiveAdd(total);
        if (digit < DIGITS) next_place[own + digit] = upto - total + block_counts[block * DIGITS + digit];
        smaller = subgroupBroadcast(upto, gl_SubgroupSize - 1);
    }
    if (COMPACT && block == 0 && subgroupElect()) count[push.kept_index] = smaller;
    subgroup_meets();

    uint end = min(keys, (block + 1) * BLOCK);
    for (uint row = block * BLOCK; row < end; row += gl_SubgroupSize) {
        uint i = row + lane;
        bool live = i < end;
        uint key = live ? keys_in[i] : NONE;
        uint value = INDEXED ? i : (live ? values_in[i] : 0);
        if (COMPACT) live = key != NONE;

        uint digit = digit_of(key, push.shift);
        uvec2 peers = same_digit(digit, live);
        uvec2 earlier = peers & gl_SubgroupLtMask.xy; // guard: ranks in the order of lanes
        uint place = 0;
        if (live) place = next_place[own + digit] + bitCount(earlier.x) + bitCount(earlier.y);
        subgroup_meets();
        if (live && highest(peers)) next_place[own + digit] = place + 1;
        subgroup_meets();
        if (live) {
            keys_out[place] = key;
            values_out[place] = value;
        }
    }
}

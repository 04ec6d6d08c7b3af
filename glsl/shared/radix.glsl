// What the three kernels of a radix sort pass agree on.
// Satish, Harris and Garland, "Designing Efficient Sorting Algorithms for Manycore GPUs", 2009; here a subgroup, not a
// workgroup, owns a block. No workgroup waits for another, so no forward progress between them is assumed.
#include "blocks.glsl"

// Width of the pass's digit, 1..8 bits.
layout(constant_id = 2) const uint DIGIT_BITS = 8;
const uint DIGITS = 1u << DIGIT_BITS;

uint digit_of(uint key, uint shift) {
    return (key >> shift) & (DIGITS - 1);
}

// The live lanes whose digit is this lane's.
uvec2 same_digit(uint digit, bool live) {
    uvec2 peers = subgroupBallot(live).xy;
    for (uint bit = 0; bit < DIGIT_BITS; bit++) {
        bool one = (digit >> bit & 1u) != 0;
        uvec2 ones = subgroupBallot(one).xy;
        peers &= one ? ones : ~ones;
    }
    return peers;
}

// Whether no lane of these is after this one.
bool highest(uvec2 lanes) {
    uvec2 later = lanes & gl_SubgroupGtMask.xy;
    return (later.x | later.y) == 0;
}

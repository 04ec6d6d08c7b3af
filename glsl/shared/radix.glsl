// Digits of a radix sort pass, shared by its three kernels.
// Satish, Harris and Garland, "Designing Efficient Sorting Algorithms for Manycore GPUs", 2009. Here a
// subgroup, not a workgroup, owns a block. No workgroup waits for another, so no forward progress between
// them is assumed.
#include "blocks.glsl"

// Width of the pass's digit, 1..10 bits.
layout(constant_id = 2) const uint DIGIT_BITS = 8;
const uint DIGITS = 1u << DIGIT_BITS;

uint digit_of(uint key, uint shift) {
    return (key >> shift) & (DIGITS - 1);
}

#version 460
// Measures multiply-adds alone: a device's compute rate if nothing waits for memory.
//
// One thread runs CHAINS independent recurrences x <- factor * x + term, for `rounds` times DEPTH steps, and
// writes their sum. -> chain_sums (by thread)
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"

// Enough to hide the latency of one multiply-add (4 to 5 cycles on GPUs and CPUs).
layout(constant_id = 1) const uint CHAINS = 8;
// Steps without a branch, over which the cost of the loop itself is spread (llvmpipe masks every variable in
// a loop).
layout(constant_id = 2) const uint DEPTH = 16;

layout(push_constant, scalar) uniform Push {
    uint count;   // threads
    uint rounds;
    float factor; // below 1, so that rounding errors fade
    float term;
} push;

layout(set = 0, binding = 0, scalar) writeonly buffer ChainSums { float chain_sums[]; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    float x[CHAINS];
    [[unroll]] for (uint k = 0; k < CHAINS; ++k) x[k] = float(i % 1024) + float(k);
    for (uint round = 0; round < push.rounds; ++round) {
        [[unroll]] for (uint n = 0; n < DEPTH; ++n)
            [[unroll]] for (uint k = 0; k < CHAINS; ++k) x[k] = fma(push.factor, x[k], push.term);
    }
    float sum = 0.0;
    [[unroll]] for (uint k = 0; k < CHAINS; ++k) sum += x[k];
    chain_sums[i] = sum;
}

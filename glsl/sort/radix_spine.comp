#version 460
// Second of three kernels of a radix sort pass: for each digit, the number of keys with it in earlier blocks.
//
// A workgroup scans the columns of gl_SubgroupSize digits, one per lane; each of its subgroups takes a segment of the
// blocks. block_counts in place, its column sums -> digit_totals.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "../shared/common.glsl"
#include "../shared/radix.glsl"

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) buffer BlockCounts { uint block_counts[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer DigitTotals { uint digit_totals[]; };

// Index in count of the number of keys.
layout(push_constant, scalar) uniform Push { uint count_index; } push;

shared uint segment_sums[gl_WorkGroupSize.x];

// Rows read before the first is written back, so that their latencies overlap.
const uint AHEAD = 8;

void main() {
    uint blocks = blocks_for(count[push.count_index]);
    uint digit = group_index() * gl_SubgroupSize + gl_SubgroupInvocationID;
    bool live = digit < DIGITS;
    uint segment = (blocks + gl_NumSubgroups - 1) / gl_NumSubgroups;
    uint begin = min(blocks, gl_SubgroupID * segment);
    uint end = live ? min(blocks, begin + segment) : begin;

    uint sum = 0;
    for (uint block = begin; block < end; block++) sum += block_counts[block * DIGITS + digit];
    segment_sums[gl_SubgroupID * gl_SubgroupSize + gl_SubgroupInvocationID] = sum;
    barrier();

    uint before = 0;
    for (uint s = 0; s < gl_SubgroupID; s++) before += segment_sums[s * gl_SubgroupSize + gl_SubgroupInvocationID];
    if (live && gl_SubgroupID == gl_NumSubgroups - 1) digit_totals[digit] = before + sum;
    uint block = begin;
    for (; block + AHEAD <= end; block += AHEAD) {
        uint counts[AHEAD];
        [[unroll]] for (uint k = 0; k < AHEAD; k++) counts[k] = block_counts[(block + k) * DIGITS + digit];
        [[unroll]] for (uint k = 0; k < AHEAD; k++) {
            block_counts[(block + k) * DIGITS + digit] = before;
            before += counts[k];
        }
    }
    for (; block < end; block++) {
        uint here = block_counts[block * DIGITS + digit];
        block_counts[block * DIGITS + digit] = before;
        before += here;
    }
}

#version 460
// First of three kernels of the exclusive prefix sum: the sum of each block.
//
// A subgroup sums one block of BLOCK values. values (or values[index]) -> block_sums.
// Sums saturate at 2^32 - 1. Reduce, spine, apply: Merrill and Grimshaw, "Parallel Scan for Stream Architectures", 2009.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/blocks.glsl"
#include "../shared/saturate.glsl"

// Item i is values[index[i]].
layout(constant_id = 2) const bool GATHER = false;

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Values { uint values[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer BlockSums { uint block_sums[]; };

// Index in count of the number of items.
layout(push_constant, scalar) uniform Push { uint count_index; } push;

void main() {
    uint items = count[push.count_index];
    uint block = subgroup_index();
    if (!(block < blocks_for(items))) return;
    uint end = min(items, (block + 1) * BLOCK);
    uint sum = 0;
    for (uint i = block * BLOCK + gl_SubgroupInvocationID; i < end; i += gl_SubgroupSize) {
        sum = saturating_add(sum, values[GATHER ? index[i] : i]);
    }
    sum = saturating_subgroup_add(sum);
    if (subgroupElect()) block_sums[block] = sum;
}

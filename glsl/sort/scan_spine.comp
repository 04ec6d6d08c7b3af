#version 460
// Second of three kernels of the exclusive prefix sum: from the sum of each block to its start.
//
// One workgroup; each subgroup scans a segment of the blocks. block_sums, in place; block_sums[blocks] and
// count[total_index] are the total. The buffer holds blocks + 1 values. Sums saturate at 2^32 - 1.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/blocks.glsl"
#include "../shared/saturate.glsl"

layout(set = 0, binding = 0, scalar) buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) buffer BlockSums { uint block_sums[]; };

// Indices in count of the number of items and of the total (not the same).
layout(push_constant, scalar) uniform Push { uint count_index; uint total_index; } push;

// One per subgroup; a subgroup has 8 lanes or more.
shared uint segment_sums[gl_WorkGroupSize.x / 8];

void main() {
    if (!(group_index() == 0)) return;
    uint blocks = blocks_for(count[push.count_index]);
    uint segment = (blocks + gl_NumSubgroups - 1) / gl_NumSubgroups;
    uint begin = min(blocks, gl_SubgroupID * segment);
    uint end = min(blocks, begin + segment);

    uint sum = 0;
    for (uint i = begin + gl_SubgroupInvocationID; i < end; i += gl_SubgroupSize) {
        sum = saturating_add(sum, block_sums[i]);
    }
    sum = saturating_subgroup_add(sum);
    if (subgroupElect()) segment_sums[gl_SubgroupID] = sum;
    barrier();

    uint before = 0;
    for (uint s = 0; s < gl_SubgroupID; s++) before = saturating_add(before, segment_sums[s]);
    // All subgroups loop equally often: Vulkan promises that a subgroup's lanes are together only in uniform
    // control flow.
    for (uint row = 0; row < segment; row += gl_SubgroupSize) {
        uint i = begin + row + gl_SubgroupInvocationID;
        uint value = i < end ? block_sums[i] : 0;
        uint offset = saturating_add(before, saturating_subgroup_exclusive_add(value));
        if (i < end) block_sums[i] = offset;
        before = saturating_add(before, saturating_subgroup_add(value));
    }
    if (gl_SubgroupID == gl_NumSubgroups - 1 && subgroupElect()) {
        block_sums[blocks] = before;
        count[push.total_index] = before;
    }
}

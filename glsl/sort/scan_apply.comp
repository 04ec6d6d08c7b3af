#version 460
// Last of three kernels of the exclusive prefix sum: from the start of each block to the start of each item.
//
// A subgroup scans one block of BLOCK values, row by row. values (or values[index]), block_sums -> offsets,
// in the order of the items. Sums saturate at 2^32 - 1; only blocks that reach it pay for saturating scans.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/blocks.glsl"
#include "../shared/saturate.glsl"

// Item i is values[index[i]].
layout(constant_id = 2) const bool GATHER = false;

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Values { uint values[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Index { uint index[]; };
layout(set = 0, binding = 3, scalar) readonly buffer BlockSums { uint block_sums[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer Offsets { uint offsets[]; };

// Index in count of the number of items.
layout(push_constant, scalar) uniform Push { uint count_index; } push;

void main() {
    uint items = count[push.count_index];
    uint block = subgroup_index();
    if (!(block < blocks_for(items))) return;
    uint end = min(items, (block + 1) * BLOCK);
    uint before = block_sums[block];
    // If the start of the next block is not saturated, no sum within this block can have wrapped.
    bool exact = block_sums[block + 1] < SATURATED; // guard: blocks that may wrap
    for (uint row = block * BLOCK; row < end; row += gl_SubgroupSize) {
        uint i = row + gl_SubgroupInvocationID;
        uint value = i < end ? values[GATHER ? index[i] : i] : 0;
        uint offset;
        if (exact) {
            uint upto = before + subgroupInclusiveAdd(value);
            offset = upto - value;
            before = subgroupBroadcast(upto, gl_SubgroupSize - 1);
        } else {
            offset = saturating_add(before, saturating_subgroup_exclusive_add(value));
            before = saturating_add(before, saturating_subgroup_add(value));
        }
        if (i < end) offsets[i] = offset;
    }
}

#version 460
// First of three kernels of a radix sort pass: counts each digit in each block.
//
// A subgroup counts one block of BLOCK keys in shared memory. keys_in -> block_counts[block * DIGITS + digit].
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/radix.glsl"
#include "../shared/meet.glsl"

// Keys of 0xFFFFFFFF are not counted.
layout(constant_id = 3) const bool COMPACT = false;
// Lanes of a subgroup, which set the number of rows of shared memory: one for each subgroup of a workgroup,
// since more shared memory means fewer resident workgroups.
layout(constant_id = 6) const uint ROW_LANES = 8;

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer KeysIn { uint keys_in[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer BlockCounts { uint block_counts[]; };

// Index in count of the number of keys; lowest bit of the digit.
layout(push_constant, scalar) uniform Push { uint count_index; uint shift; } push;

// A row per subgroup: 8 KiB with subgroups of 8 lanes at a workgroup of 64 and digits of 8 bits, 2 KiB with
// 32 lanes.
shared uint digit_counts[(gl_WorkGroupSize.x / ROW_LANES) * DIGITS];

void main() {
    uint keys = count[push.count_index];
    uint block = subgroup_index();
    if (!(block < blocks_for(keys))) return;
    uint lane = gl_SubgroupInvocationID;
    uint own = gl_SubgroupID * DIGITS;
    for (uint d = lane; d < DIGITS; d += gl_SubgroupSize) digit_counts[own + d] = 0;
    subgroup_meets();

    uint end = min(keys, (block + 1) * BLOCK);
    for (uint i = block * BLOCK + lane; i < end; i += gl_SubgroupSize) {
        uint key = keys_in[i];
        if (!COMPACT || key != NONE) atomicAdd(digit_counts[own + digit_of(key, push.shift)], 1);
    }
    subgroup_meets();
    for (uint d = lane; d < DIGITS; d += gl_SubgroupSize) block_counts[block * DIGITS + d] = digit_counts[own + d];
}

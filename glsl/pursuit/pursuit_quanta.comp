#version 460
// Converts each block's share of the squared error to an integer, so that pixels can be drawn by an exact
// prefix sum.
//
// One workgroup: error_sums -> quanta, floor(2^30 * sum / total), at most 2^30; all 0 if the total is 0 or
// not finite. Each thread sums its blocks in order, then subgroups are summed: the order is always the same.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/unit.glsl"

layout(push_constant, scalar) uniform Push { uint count; } push;

layout(set = 0, binding = 0, scalar) readonly buffer ErrorSums { float error_sums[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Quanta { uint quanta[]; };

shared float subgroup_sums[gl_WorkGroupSize.x / 8]; // a subgroup has 8 lanes or more

void main() {
    if (group_index() != 0) return;
    float sum = 0.0;
    for (uint b = gl_LocalInvocationIndex; b < push.count; b += gl_WorkGroupSize.x) sum += error_sums[b];
    sum = subgroupAdd(sum);
    if (subgroupElect()) subgroup_sums[gl_SubgroupID] = sum;
    barrier();
    float total = 0.0;
    for (uint s = 0; s < gl_NumSubgroups; ++s) total += subgroup_sums[s];
    bool usable = total > 0.0 && total <= FLOAT_MAX;
    for (uint b = gl_LocalInvocationIndex; b < push.count; b += gl_WorkGroupSize.x) {
        quanta[b] = usable ? uint(clamp(error_sums[b] / total, 0.0, 1.0) * 1073741824.0) : 0u;
    }
}

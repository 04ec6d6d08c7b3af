#version 460
// Sums ssim_forward's tile sums into the losses of each frame, in a fixed order.
//
// A workgroup takes one frame. tile_sums -> losses[first + frame].
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/ssim.glsl"

layout(constant_id = 1) const float SSIM_WEIGHT = 0.2;

// Means over a frame's pixels and channels, and the loss computed from them.
struct Loss {
    float l1;
    float squared;
    float ssim;
    float total;
};

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer TileSums { vec3 tile_sums[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer Losses { Loss losses[]; };

layout(push_constant, scalar) uniform Push { uint frame_first; uint frame_count; uint tiles_per_frame; uint first; } push;

// One per subgroup; a subgroup has 8 lanes or more.
shared vec3 subgroup_sums[gl_WorkGroupSize.x / 8];

void main() {
    uint frame_index = group_index();
    if (!(frame_index < push.frame_count)) return;
    Frame frame = frames[push.frame_first + frame_index];
    vec3 sums = vec3(0);
    for (uint tile = gl_LocalInvocationIndex; tile < tiles_of(frame); tile += gl_WorkGroupSize.x) {
        sums += tile_sums[frame_index * push.tiles_per_frame + tile];
    }
    sums = vec3(subgroupAdd(sums.x), subgroupAdd(sums.y), subgroupAdd(sums.z));
    if (subgroupElect()) subgroup_sums[gl_SubgroupID] = sums;
    barrier();
    if (gl_LocalInvocationIndex == 0) {
        for (uint s = 1; s < gl_NumSubgroups; s++) sums += subgroup_sums[s];
        vec3 mean = sums / (3 * float(frame.width) * float(frame.height));
        float total = (1 - SSIM_WEIGHT) * mean.x + SSIM_WEIGHT * (1 - mean.z);
        losses[push.first + frame_index] = Loss(mean.x, mean.y, mean.z, total);
    }
}

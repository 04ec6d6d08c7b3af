#version 460
// Turns a count on the GPU into an indirect dispatch, and keeps it within what the buffers hold.
//
// One thread. count[count_index] is clamped to capacity; where it was larger, status[status_index] becomes the largest
// number ever needed. dispatch_args[args_index..] = the VkDispatchIndirectCommand of ceil(count / items_per_group)
// workgroups, folded into two dimensions of at most 65,535 (the least maxComputeWorkGroupCount that Vulkan allows); at
// least one workgroup, so that kernels that also write a total do so for a count of 0.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"

layout(set = 0, binding = 0, scalar) buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer DispatchArgs { uint dispatch_args[]; };
layout(set = 0, binding = 2, scalar) buffer Status { uint status[]; };

// args_index in words; an items_per_group of 0 is taken as 1.
layout(push_constant, scalar) uniform Push {
    uint count_index;
    uint capacity;
    uint items_per_group;
    uint args_index;
    uint status_index;
} push;

const uint GROUPS_PER_DIMENSION = 65535;

void main() {
    if (!(thread_index() == 0)) return;
    uint items = count[push.count_index];
    if (items > push.capacity) {
        status[push.status_index] = max(status[push.status_index], items);
        items = push.capacity;
        count[push.count_index] = items;
    }
    uint per_group = max(1u, push.items_per_group);
    uint groups = max(1u, items / per_group + uint(items % per_group != 0));
    uint rows = (groups - 1) / GROUPS_PER_DIMENSION + 1;
    // Spread over the rows evenly: fewer than `rows` workgroups are beyond the end.
    dispatch_args[push.args_index] = (groups - 1) / rows + 1;
    dispatch_args[push.args_index + 1] = rows;
    dispatch_args[push.args_index + 2] = 1;
}

#version 460
// Turns a count on the GPU into an indirect dispatch, clamped to the buffers' capacity.
//
// One thread. count[count_index] is clamped to capacity. status records the demand for the resource and, if
// it exceeds capacity, the failure; NO_RESOURCE records nothing. dispatch_args[args_index..] is the
// VkDispatchIndirectCommand of the workgroups, see shared/dispatch.glsl.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/status.glsl"
#include "../shared/dispatch.glsl"

layout(set = 0, binding = 0, scalar) buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer DispatchArgs { uint dispatch_args[]; };
layout(set = 0, binding = 2, scalar) buffer Status { uint status[]; };

layout(push_constant, scalar) uniform Push {
    uint count_index;
    uint capacity;
    uint items_per_group; // 0 counts as 1
    uint args_index;      // words
    uint resource_index;  // see shared/status.glsl
} push;

void main() {
    if (!(thread_index() == 0)) return;
    uint items = count[push.count_index];
    bool told = push.resource_index != NO_RESOURCE;
    uint needed = STATUS_NEEDED + push.resource_index;
    if (told) status[needed] = max(status[needed], items);
    if (items > push.capacity) {
        if (told) status[STATUS_FAILED] |= 1u << push.resource_index; // guard: what does not fit is told
        items = push.capacity;
        count[push.count_index] = items;
    }
    uvec3 groups = groups_for(items, push.items_per_group);
    for (uint d = 0; d < 3; ++d) dispatch_args[push.args_index + d] = groups[d];
}

#version 460
// Computes the new number of Gaussians, and the number of children drawn.
//
// One thread. words (OLD, ALIVE, CANDIDATES) -> words, dispatch_args of a thread for each child. The new
// number is the larger of `target` and OLD plus an `nth` of OLD. Its limits are the capacity and, without
// REPLACEMENT, ALIVE plus one child of each candidate. If none is alive, or status says that the step did not
// fit, all stay unchanged: ALIVE and NEW become OLD.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/status.glsl"
#include "../shared/dispatch.glsl"
#include "../shared/density.glsl"

layout(constant_id = 1) const bool REPLACEMENT = false;

layout(push_constant, scalar) uniform Push {
    uint capacity;
    uint target;
    uint nth;               // 0: target alone
    uint threads_per_group; // of density_draw
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 1, scalar) buffer Words { uint words[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer DispatchArgs { uint dispatch_args[]; };

void main() {
    if (!(thread_index() == 0)) return;
    uint old = words[OLD], alive = words[ALIVE], candidates = words[CANDIDATES], children = 0;
    bool still = status[STATUS_FAILED] != 0 || alive == 0; // guard: density: steps that fit; density: something alive
    if (still) alive = old;
    if (!still) {
        uint more = push.nth > 0 ? old + old / push.nth : 0;
        uint target = min(max(push.target, more), push.capacity); // guard: density: the limit
        if (target > alive) children = target - alive;
        if (REPLACEMENT) {
            if (candidates == 0) children = 0; // guard: density: something to draw
        } else {
            children = min(children, candidates); // guard: density: each once
        }
    }
    words[ALIVE] = alive;
    words[CHILDREN] = children;
    words[NEW] = alive + children;
    uvec3 groups = groups_for(children, push.threads_per_group);
    for (uint d = 0; d < 3; ++d) dispatch_args[d] = groups[d];
}

#version 460
// Counts a training step, unless it was skipped because a buffer was too small.
//
// One thread. status -> status
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/status.glsl"

layout(set = 0, binding = 0, scalar) buffer Status { uint status[]; };

void main() {
    // guard: nothing counts after an overflow
    if (thread_index() == 0 && status[STATUS_FAILED] == 0) status[STATUS_STEPS] += 1;
}

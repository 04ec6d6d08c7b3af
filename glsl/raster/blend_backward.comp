#version 460
// Gradients of the blended image, one record for each intersection: no atomics, the same bits every run.
//
// See shared/backward.glsl. project_backward and plane_backward sum a Gaussian's records in their order.
// tile_ranges, isect_slots, global_from_slot, splats, image, image_grad -> isect_grads (9 floats by slot)
// isect_grads begin at 0.
#extension GL_GOOGLE_include_directive : require
#include "../shared/backward.glsl"

layout(set = 0, binding = 7, scalar) writeonly buffer IsectGrads { float isect_grads[]; };

void put(uint slot, uint global, float record[RECORD]) {
    [[unroll]] for (uint r = 0; r < RECORD; ++r) isect_grads[slot * RECORD + r] = record[r];
}

void main() { tile_backward(); }

#version 460
// Gradients of the blended image, one record for each Gaussian: for scenes whose records by intersection find no room.
//
// See shared/backward.glsl. The tiles of a Gaussian add up in any order, so two runs differ in the last bits.
// tile_ranges, isect_slots, global_from_slot, splats, image, image_grad, splat_grads -> splat_grads (9 floats by Gaussian)
// splat_grads begin at 0. Needs shaderBufferFloat32AtomicAdd.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_atomic_float : require
#include "../shared/backward.glsl"

layout(set = 0, binding = 7, scalar) buffer SplatGrads { float splat_grads[]; };

void put(uint slot, uint global, float record[RECORD]) {
    [[unroll]] for (uint r = 0; r < RECORD; ++r) {
        if (record[r] != 0.0) atomicAdd(splat_grads[global * RECORD + r], record[r]);
    }
}

void main() { tile_backward(); }

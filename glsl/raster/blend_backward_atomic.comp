#version 460
// Gradients of the blended image, one record for each Gaussian: for scenes whose records by intersection do
// not fit.
//
// See shared/backward.glsl. The tiles of a Gaussian add up in any order, so two runs differ in the last bits.
// tile_ranges, isect_slots, rank_blocks, global_from_rank, splats, splat_colors, image, image_grad, population, tile_list,
// tile_list_count -> records (by Gaussian), which are added to. Needs shaderBufferFloat32AtomicAdd.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_atomic_float : require
#include "../shared/backward.glsl"

layout(set = 0, binding = 12, scalar) buffer RecordCentres { vec3 record_centres[]; };
layout(set = 0, binding = 13, scalar) buffer RecordShapes { vec3 record_shapes[]; };
layout(set = 0, binding = 14, scalar) buffer RecordColors { vec3 record_colors[]; };

void put(uint slot, uint global, bool all, Record record) {
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        if (!SCORES && record.centre[c] != 0.0) atomicAdd(record_centres[global][c], record.centre[c]);
        if (!SCORES && all && record.shape[c] != 0.0) atomicAdd(record_shapes[global][c], record.shape[c]);
        // guard: atomic sums
        if (all && record.color[c] != 0.0) atomicAdd(record_colors[global][c], record.color[c]);
    }
}

void main() { tile_backward(); }

#version 460
// Gradients of the blended image, one record for each intersection: no atomics, the same bits every run.
//
// See shared/backward.glsl. project_backward and screen_backward sum a Gaussian's records in their order.
// tile_ranges, isect_slots, rank_blocks, global_from_rank, splats, splat_colours, image, image_grad, population -> records (by slot), which
// begin at 0.
#extension GL_GOOGLE_include_directive : require
#include "../shared/backward.glsl"

layout(set = 0, binding = 10, scalar) writeonly buffer RecordCentres { vec3 record_centres[]; };
layout(set = 0, binding = 11, scalar) writeonly buffer RecordShapes { vec3 record_shapes[]; };
layout(set = 0, binding = 12, scalar) writeonly buffer RecordColours { vec3 record_colours[]; };

void put(uint slot, uint global, bool all, Record record) {
    record_centres[slot] = record.centre;
    if (!all) return;
    record_shapes[slot] = record.shape;
    record_colours[slot] = record.colour;
}

void main() { tile_backward(); }

#version 460
// Gradients of the blended image, one record for each intersection: no atomics, the same bits every run.
//
// See shared/backward.glsl. project_backward, screen_backward and density_score sum a Gaussian's records.
// tile_ranges, isect_slots, rank_blocks, global_from_rank, splats, splat_colors, image, image_grad, population, tile_list,
// tile_list_count -> records (by slot), which start at 0: in three buffers, or with PACKED_RECORDS in words.
// Records of SCORES are not packed: two floats in the first words.
#extension GL_GOOGLE_include_directive : require
#include "../shared/backward.glsl"
#include "../shared/packed_record.glsl"

layout(set = 0, binding = 12, scalar) writeonly buffer RecordCentres { vec3 record_centres[]; };
layout(set = 0, binding = 13, scalar) writeonly buffer RecordShapes { vec3 record_shapes[]; };
layout(set = 0, binding = 14, scalar) writeonly buffer RecordColors { vec3 record_colors[]; };
layout(set = 0, binding = 15, scalar) writeonly buffer RecordWords { uvec4 record_words[]; };

void put(uint slot, uint global, bool all, Record record) {
    if (PACKED_RECORDS) {
        record_words[slot] = SCORES ? uvec4(floatBitsToUint(record.color.xy), 0, 0)
                                    : pack_record(record.centre, record.shape, record.color, !all);
        return;
    }
    if (!SCORES) record_centres[slot] = record.centre;
    if (!SCORES && all) record_shapes[slot] = record.shape;
    if (all) record_colors[slot] = record.color;
}

void main() { tile_backward(); }

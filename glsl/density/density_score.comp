#version 460
// Adds one view's contribution to each Gaussian's scores.
//
// One thread takes one Gaussian of a page and sums its records, see shared/records.glsl. With PULLS the
// records are those of the loss, and the length of the mean's gradient in the image is added, in halves of
// the image's sides as in 3DGS. Without, the records are those of blend_backward with SCORES, and error and
// blend weight are added.
// population, records, first_slot, tile_counts, splats (by Gaussian index), scores -> scores
// Limits: sums that are not finite are not added. Nothing is added once status says that the step did not
// fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/unit.glsl"
#include "../shared/population.glsl"
#include "../shared/status.glsl"
#include "../shared/splat.glsl"
#include "../shared/density.glsl"

layout(constant_id = 1) const bool PULLS = false;

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first;  // number in the segment of the page's first Gaussian
    uint stride;      // the page's capacity
    uint by_gaussian; // records are by Gaussian, added up already
    float half_width, half_height; // of the image, px
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 2, scalar) readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 3, scalar) readonly buffer FirstSlot { uint first_slot[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Splats { Splat splats[]; };
#define RECORD_CENTRES 5
#define RECORD_SHAPES 6
#define RECORD_COLORS 7
#define RECORD_WORDS 9
#include "../shared/records.glsl"
layout(set = 0, binding = 8, scalar) buffer Scores { vec4 scores[]; };

#define SUMS 3
#include "../shared/sums.glsl"
void add(uint at, inout float sums[SUMS]) {
    vec3 part;
    if (!packed_records()) {
        part = PULLS ? record_centres[at] : record_colors[at];
    } else if (PULLS) {
        vec3 shape, color;
        unpack_record(record_words[at], part, shape, color);
    } else {
        part = vec3(uintBitsToFloat(record_words[at].xy), 0.0);
    }
    [[unroll]] for (uint c = 0; c < SUMS; ++c) sums[c] += part[c];
}

void main() {
    uint place = thread_index();
    uint i = segment_first[push.segment] + push.page_first + place; // Gaussian index
    bool live = place < push.stride && i < segment_first[push.segment + 1];
    if (status[STATUS_FAILED] != 0) return;
    uvec2 own = live ? records_of(i) : uvec2(0);
    float sums[SUMS];
    sum_over(own, sums);
    if (!live) return;
    vec3 sum = vec3(sums[0], sums[1], sums[2]);
    vec2 more = sum.xy;
    if (PULLS) {
        Splat s = splats[i];
        vec2 centre = vec2(s.shape.x * sum.x, s.shape.y * sum.x + s.shape.z * sum.y) * vec2(push.half_width, push.half_height);
        bool blended = own.y > 0 && (sum.z != 0.0 || sum.x != 0.0 || sum.y != 0.0);
        more = blended ? vec2(length(centre), 1.0) : vec2(0.0);
    }
    if (!(more.x <= FLOAT_MAX && more.y <= FLOAT_MAX)) return;
    scores[place] += PULLS ? vec4(0.0, 0.0, more) : vec4(more, 0.0, 0.0); // PULL and SEEN, or ERROR and WEIGHT
}

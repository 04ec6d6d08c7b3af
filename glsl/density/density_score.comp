#version 460
// Adds what a view says of each Gaussian to its scores.
//
// One thread takes one Gaussian of a page and sums its records in their order, see shared/records.glsl. With PULLS the records are
// the loss's and the length of the mean's gradient in the image is added, in halves of the image's sides as 3DGS has it; else they
// are those of density_image, and error and blend weight are.
// population, records, first_slot, tile_counts, splats (by Gaussian index), scores -> scores
// Limits: what is not finite is not added. Nothing is added once status says that the step did not fit.
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
#define RECORD_COLOURS 7
#include "../shared/records.glsl"
layout(set = 0, binding = 8, scalar) buffer Scores { vec4 scores[]; };

void main() {
    uint place = thread_index();
    uint i = segment_first[push.segment] + push.page_first + place; // Gaussian index
    if (!(place < push.stride && i < segment_first[push.segment + 1])) return;
    if (status[STATUS_FAILED] != 0) return;
    uvec2 own = records_of(i, push.by_gaussian != 0);
    vec3 sum = vec3(0.0);
    for (uint slot = own.x; slot < own.x + own.y; ++slot) sum += PULLS ? record_centres[slot] : record_colours[slot];
    vec2 add = sum.xy;
    if (PULLS) {
        Splat s = splats[i];
        vec2 centre = vec2(s.shape.x * sum.x, s.shape.y * sum.x + s.shape.z * sum.y) * vec2(push.half_width, push.half_height);
        bool blended = own.y > 0 && (sum.z != 0.0 || sum.x != 0.0 || sum.y != 0.0);
        add = blended ? vec2(length(centre), 1.0) : vec2(0.0);
    }
    if (!(add.x <= FLOAT_MAX && add.y <= FLOAT_MAX)) return;
    scores[place] += PULLS ? vec4(0.0, 0.0, add) : vec4(add, 0.0, 0.0); // PULL and SEEN, or ERROR and WEIGHT
}

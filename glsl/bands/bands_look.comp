#version 460
// The color that a view's pixels ask of each Gaussian, and its weight.
//
// One thread takes one Gaussian of a page and sums its records, which are those of blend_backward with SCORES,
// of density_image with RED_GREEN in the first pass and BLUE in the second. With w the blend weight of a pixel and r the image's difference from the
// photograph, the color is the Gaussian's own less sum w r / sum w: if all Gaussians take theirs, no pixel
// overshoots, since its weights sum to at most 1.
// population, records, first_slot, tile_counts, splat_colors (by Gaussian index) -> looks: sums of red and green in the
// first pass; color and weight in the second, all 0 if the view gives the Gaussian no weight.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/unit.glsl"
#include "../shared/population.glsl"
#include "../shared/status.glsl"
#include "../shared/bands.glsl"

layout(constant_id = 1) const bool SECOND = false;

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first;  // number in the segment of the page's first Gaussian
    uint stride;      // the page's capacity
    uint by_gaussian; // records are by Gaussian, added up already
    uint view;        // row of looks
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 2, scalar) readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 3, scalar) readonly buffer FirstSlot { uint first_slot[]; };
layout(set = 0, binding = 4, scalar) readonly buffer SplatColors { vec3 splat_colors[]; };
#define RECORD_CENTRES 5
#define RECORD_SHAPES 6
#define RECORD_COLORS 7
#define RECORD_WORDS 9
#include "../shared/records.glsl"
layout(set = 0, binding = 8, scalar) buffer Looks { vec4 looks[]; };

#define SUMS 2
#include "../shared/sums.glsl"
void add(uint at, inout float sums[SUMS]) {
    vec2 part = packed_records() ? uintBitsToFloat(record_words[at].xy) : record_colors[at].xy;
    sums[0] += part.x;
    sums[1] += part.y;
}

void main() {
    uint place = thread_index();
    uint i = segment_first[push.segment] + push.page_first + place; // Gaussian index
    bool live = place < push.stride && i < segment_first[push.segment + 1];
    if (status[STATUS_FAILED] != 0) return;
    float sums[SUMS];
    sum_over(live ? records_of(i) : uvec2(0), sums);
    if (!live) return;
    uint at = push.view * push.stride + place;
    if (!SECOND) {
        looks[at] = vec4(sums[0], sums[1], 0.0, 0.0);
        return;
    }
    float weight = sums[1];
    vec3 color = splat_colors[i] - vec3(looks[at].xy, sums[0]) / weight;
    // guard: bands: weights and colors of a view
    bool fine = weight >= LEAST_WEIGHT && max(abs(color.x), max(abs(color.y), abs(color.z))) <= MOST_COLOR;
    looks[at] = fine ? vec4(color, weight) : vec4(0.0);
}

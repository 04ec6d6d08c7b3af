#version 460
// Applies a new number of Gaussians: updates the first index of each segment and the dispatches over its
// pages.
//
// One thread. segment_counts grows by added[added_index] in `segment`, or not at all if added_index is NONE,
// and is clamped to the pages' capacity; status reports if it was more. segment_counts, added, pages ->
// segment_counts, population, population_args: page p's dispatch at word 3 p, then those over the blocks of
// all Gaussians up to the end of each segment.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/status.glsl"
#include "../shared/dispatch.glsl"
#include "../shared/saturate.glsl"

layout(push_constant, scalar) uniform Push {
    uint page_count;
    uint threads_per_group; // of kernels with one thread for each Gaussian of a page
    uint items_per_group;   // of kernels that take blocks
    uint segment;
    uint added_index;       // NONE: nothing is added
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Added { uint added[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Pages { Page pages[]; };
layout(set = 0, binding = 2, scalar) buffer SegmentCounts { uint segment_counts[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer PopulationArgs { uint population_args[]; };
layout(set = 0, binding = 5, scalar) buffer Status { uint status[]; };

void put(uint dispatch, uint items, uint per_group) {
    uvec3 groups = groups_for(items, per_group);
    for (uint d = 0; d < 3; ++d) population_args[3 * dispatch + d] = groups[d];
}

void main() {
    if (!(thread_index() == 0)) return;
    uint capacity[SEGMENTS], count[SEGMENTS];
    for (uint s = 0; s < SEGMENTS; ++s) {
        capacity[s] = 0;
        count[s] = segment_counts[s];
    }
    for (uint p = 0; p < push.page_count; ++p) capacity[pages[p].segment] += pages[p].capacity;
    if (push.added_index != NONE) count[push.segment] = saturating_add(count[push.segment], added[push.added_index]);
    uint first = 0;
    for (uint s = 0; s < SEGMENTS; ++s) {
        if (count[s] > capacity[s]) {
            uint short_of = BASE_GAUSSIANS + s;
            status[STATUS_FAILED] |= 1u << short_of;
            status[STATUS_NEEDED + short_of] = max(status[STATUS_NEEDED + short_of], count[s]);
            count[s] = capacity[s];
        }
        segment_counts[s] = count[s];
        segment_first[s] = first;
        first += count[s];
        put(push.page_count + s, first, push.items_per_group);
    }
    segment_first[SEGMENTS] = first;
    for (uint p = 0; p < push.page_count; ++p) {
        Page page = pages[p];
        uint here = count[page.segment] > page.first ? min(count[page.segment] - page.first, page.capacity) : 0;
        put(p, here, push.threads_per_group);
    }
}

#version 460
// Appends lifts to a segment's Gaussians, compacted, in their order.
//
// One thread takes one lift; a dispatch fills one page. lifts, lift_flags (1: of this segment), lift_ranks
// (their exclusive scan), population -> geometry, sh and, with HAS_LOBES, lobes of the Gaussian whose number
// in the segment is its count + rank. DC comes from the lift, all other SH are 0, sharpness is 0. A lift
// outside the page is left to another dispatch, or does not fit, which `recount` reports.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/lift.glsl"

layout(constant_id = 1) const bool HAS_LOBES = true;

layout(push_constant, scalar) uniform Push {
    uint count;           // lifts
    uint segment;
    uint page_first;      // number in the segment of the page's first Gaussian
    uint stride;          // the page's capacity
    uint sh_coefficients; // (L + 1)^2
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Lifts { Lift lifts[]; };
layout(set = 0, binding = 1, scalar) readonly buffer LiftRanks { uint lift_ranks[]; };
layout(set = 0, binding = 2, scalar) readonly buffer LiftFlags { uint lift_flags[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Population { uint segment_first[]; };
#define GEOMETRY 4
#define SH 5
#define LOBES 6
#define MODEL_STORES
#include "../shared/model.glsl"

void main() {
    uint item = thread_index();
    if (item >= push.count) return;
    if (lift_flags[item] == 0) return;
    Lift lift = lifts[item];
    uint number = segment_first[push.segment + 1] - segment_first[push.segment] + lift_ranks[item];
    uint place = number - push.page_first;
    if (!(number >= push.page_first && place < push.stride)) return; // guard: lifts within the room
    store_geometry3(MEAN, place, lift.mean);
    store_geometry3(LOG_SCALE, place, lift.log_scale);
    store_quat(place, lift.quat);
    store_geometry(OPACITY, place, lift.opacity);
    for (uint p = 0; p < 3 * push.sh_coefficients; ++p) store_sh(p, place, p < 3 ? lift.dc[p] : 0.0);
    if (!HAS_LOBES) return;
    store_lobe_direction(place, lift.lobe_dir);
    store_lobe(LOBE_WIDTH, place, lift.lobe_width);
    store_lobe(LOBE_SHARPNESS, place, 0.0);
}

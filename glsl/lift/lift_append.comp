#version 460
// Lifts become supplementary Gaussians behind those that there are, closed up in the order of their 2D Gaussians.
//
// One thread takes one 2D Gaussian; a dispatch fills one page. lifts, lift_ranks (exclusive scan of lift_flags), population
// -> geometry, sh, lobes of the Gaussian whose number in the supplement is its count + rank. DC from the lift, all other SH 0,
// sharpness 0. What is not within the page is left to another dispatch, or does not fit; `recount` then says so.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/lift.glsl"

layout(push_constant, scalar) uniform Push {
    uint count;           // 2D Gaussians
    uint page_first;      // number in the supplement of the page's first Gaussian
    uint stride;          // the page's capacity
    uint sh_coefficients; // (L + 1)^2
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Lifts { Lift lifts[]; };
layout(set = 0, binding = 1, scalar) readonly buffer LiftRanks { uint lift_ranks[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Population { uint segment_first[]; };
#define GEOMETRY 3
#define SH 4
#define LOBES 5
#define MODEL_STORES
#include "../shared/model.glsl"

void main() {
    uint item = thread_index();
    if (item >= push.count) return;
    Lift lift = lifts[item];
    if (lift.cluster_size == 0) return;
    uint number = segment_first[SUPPLEMENT + 1] - segment_first[SUPPLEMENT] + lift_ranks[item];
    uint place = number - push.page_first;
    if (!(number >= push.page_first && place < push.stride)) return; // guard: lifts within the room
    store_geometry3(MEAN, place, lift.mean);
    store_geometry3(LOG_SCALE, place, lift.log_scale);
    store_quat(place, lift.quat);
    store_geometry(OPACITY, place, lift.opacity);
    for (uint p = 0; p < 3 * push.sh_coefficients; ++p) store_sh(p, place, p < 3 ? lift.dc[p] : 0.0);
    store_lobe_direction(place, lift.lobe_dir);
    store_lobe(LOBE_WIDTH, place, lift.lobe_width);
    store_lobe(LOBE_SHARPNESS, place, 0.0);
}

#version 460
// Lets candidates claim the cells of CELL * CELL pixels that they would change most in the views of a page;
// the largest gain wins a cell.
//
// One subgroup takes one candidate, its lanes one view after another. The first dispatch claims: gains ->
// claims (the largest gain, as bits, which order like the numbers). The second, with CHECK: claims -> beaten,
// 1 for a candidate that lost one of its cells. Equal gains both win.
#extension GL_GOOGLE_include_directive : require
#define PURSUIT_READS
#define PURSUIT_SIGHTS 8
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"

layout(constant_id = 1) const bool CHECK = false;

layout(push_constant, scalar) uniform Push {
    uint count;
    uint view_first, view_end;
    uint begin; // 1: no candidate is beaten yet
    uint words; // of `sights`, for each candidate
} push;

layout(set = 0, binding = 4, scalar) readonly buffer Fits { Fit fits[]; };
layout(set = 0, binding = 5, scalar) readonly buffer Gains { float gains[]; };
layout(set = 0, binding = 6, scalar) buffer Claims { uint claims[]; };
layout(set = 0, binding = 7, scalar) buffer Beaten { uint beaten[]; };

// Claims the cells of view v, or with CHECK tells whether another has a higher claim to one of them.
bool claim_in(uint v, Candidate c, Fit fit, uint mine) {
    View view = views[v];
    Sight s;
    if (!sees(v, view, c, s)) return false;
    if (!(fit.opacity * lobe_factor(s.theta, fit.width) > 0.0)) return false;
    uvec4 window = window_of(view, s, CORE * footprint_px(view, s.z, fit.sigma));
    uint across = (view.width + CELL - 1) / CELL;
    bool lost = false;
    for (uint y = window.y / CELL; y <= window.w / CELL; ++y) {
        for (uint x = window.x / CELL; x <= window.z / CELL; ++x) {
            uint cell = plots[v].cell_first + y * across + x;
            if (CHECK) lost = lost || claims[cell] > mine;
            else atomicMax(claims[cell], mine);
        }
    }
    return lost;
}

void main() {
    uint i = subgroup_index();
    if (i >= push.count) return;
    float gain = gains[i];
    bool lost = CHECK && push.begin == 0 && beaten[i] != 0;
    if (gain > 0.0 && !lost) {
        Candidate c = candidates[i];
        Fit fit = fits[i];
        for (uint first = push.view_first; first < push.view_end; first += gl_SubgroupSize) {
            uint v = first + gl_SubgroupInvocationID;
            if (v < push.view_end && shows(i, push.words, v)) lost = claim_in(v, c, fit, floatBitsToUint(gain));
            if (CHECK && subgroupAny(lost)) break;
        }
    }
    if (CHECK) {
        lost = subgroupAny(lost);
        if (subgroupElect()) beaten[i] = uint(lost);
    }
}

#version 460
// Finds the views of a page in which the fit of each candidate shows: those that see it, from within its lobe.
// They are the same in all rounds of choosing, which pass over the others.
//
// One thread takes one candidate and one word, 32 views. views, plots, surface_depths, candidates, fits ->
// sights: bit v % 32 of a candidate's word v / 32 is 1 if its fit shows in view v.
#extension GL_GOOGLE_include_directive : require
#define PURSUIT_READS
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"

layout(push_constant, scalar) uniform Push {
    uint count;
    uint words; // for each candidate
    uint view_first, view_end;
    uint begin; // 1: no bit is set yet
} push;

layout(set = 0, binding = 4, scalar) readonly buffer Fits { Fit fits[]; };
layout(set = 0, binding = 5, scalar) buffer Sights { uint sights[]; };

void main() {
    uint item = thread_index();
    if (item >= push.count * push.words) return;
    uint i = item / push.words, first = 32 * (item % push.words);
    uint bits = push.begin != 0 ? 0 : sights[item];
    Fit fit = fits[i];
    if (fit.gain > 0.0) {
        Candidate c = candidates[i];
        uint end = min(first + 32, push.view_end);
        for (uint v = max(first, push.view_first); v < end; ++v) {
            Sight s;
            if (sees(v, views[v], c, s) && (fit.width == 0.0 || s.theta < PI * fit.width)) bits |= 1u << (v - first);
        }
    }
    sights[item] = bits;
}

#version 460
// Takes the undefeated candidates of a round and marks the part of the residual that they explain in the
// views of a page, so that others cannot gain it again.
//
// One subgroup takes one candidate, its lanes one view after another. gains, beaten -> explained, and with
// `last` gain_keys: the complement of the gain's bits, which sorts by falling gain; NONE if the candidate is
// not chosen.
// A candidate explains share * exp(-d^2 / (2 deviation^2)) of a pixel's residual. `share` is the part of the
// residual that its change of the color covers along the residual, clamped to between 0 and MOST.
// `explained` adds this up in integers, WHOLE for all of a residual, so that the order of candidates does not
// matter. Two candidates may explain more than there is.
#extension GL_GOOGLE_include_directive : require
#define PURSUIT_READS
#define PURSUIT_TEXELS 4
#define PURSUIT_SIGHTS 10
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"

layout(push_constant, scalar) uniform Push {
    uint count;
    uint view_first, view_end;
    uint last; // 1: this is the last page
    uint words; // of `sights`, for each candidate
} push;

layout(set = 0, binding = 5, scalar) readonly buffer Fits { Fit fits[]; };
layout(set = 0, binding = 6, scalar) readonly buffer Gains { float gains[]; };
layout(set = 0, binding = 7, scalar) readonly buffer Beaten { uint beaten[]; };
layout(set = 0, binding = 8, scalar) buffer Explained { uint explained[]; };
layout(set = 0, binding = 9, scalar) writeonly buffer GainKeys { uint gain_keys[]; };

const float MOST = 2.0;    // shares of a residual: at twice the residual, as much is missing as before
const float LEAST = 1e-6;  // smallest squared residual that counts: a quarter of a step of 8 bits

void main() {
    uint i = subgroup_index();
    if (i >= push.count) return;
    float gain = gains[i];
    if (!(gain > 0.0) || beaten[i] != 0) return;
    Candidate c = candidates[i];
    Fit fit = fits[i];
    for (uint v = push.view_first + gl_SubgroupInvocationID; v < push.view_end; v += gl_SubgroupSize) {
        if (!shows(i, push.words, v)) continue;
        View view = views[v];
        Sight s;
        if (!sees(v, view, c, s)) continue;
        float alpha = fit.opacity * lobe_factor(s.theta, fit.width);
        if (!(alpha > 0.0)) continue;
        float deviation = footprint_px(view, s.z, fit.sigma);
        Beneath under = look(plots[v], view, s.at, deviation);
        vec3 r = 2.0 * under.difference, change = alpha * (fit.color - under.render);
        float share = clamp(dot(change, r) / max(dot(r, r), LEAST), 0.0, MOST);
        uvec4 window = window_of(view, s, REACH * deviation);
        for (uint y = window.y; y <= window.w; ++y) {
            for (uint x = window.x; x <= window.z; ++x) {
                vec2 d = (vec2(x, y) - vec2(s.pixel % view.width, s.pixel / view.width)) / deviation;
                uint pixel = plots[v].pixel_first + y * view.width + x;
                atomicAdd(explained[pixel], uint(WHOLE * share * exp(-0.5 * dot(d, d)) + 0.5));
            }
        }
    }
    if (push.last != 0 && subgroupElect()) gain_keys[i] = ~floatBitsToUint(gain);
}

#version 460
// Computes the gain of every candidate not yet chosen in the views of a page, given the part of the residual
// that earlier choices explain. A candidate that gains nothing in one round is out in all later ones: the gain of its fit becomes 0.
//
// One subgroup takes one candidate, its lanes one view after another: most candidates are out after a few
// rounds, and their subgroups end at once. views, plots, surface_depths, texels, explained, candidates, fits,
// gain_keys -> gains and their squares by view, which are added to in the order of views, so that neither the
// subgroup's size nor the split into pages changes a rounding. With `last`, `doubt` times the standard
// error is subtracted; its estimate from the views is the root of the sum of squares. See pursuit_score for
// the gain; the residual here is the part still unexplained, which is negative if too much was explained.
#extension GL_GOOGLE_include_directive : require
#define PURSUIT_READS
#define PURSUIT_TEXELS 4
#define PURSUIT_SIGHTS 10
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"

layout(push_constant, scalar) uniform Push {
    uint count;
    uint view_first, view_end;
    uint begin; // 1: the gains start at 0
    uint last;  // 1: this is the last page
    float caution;
    float doubt;
    uint words; // of `sights`, for each candidate
} push;

layout(set = 0, binding = 5, scalar) readonly buffer Explained { uint explained[]; };
layout(set = 0, binding = 6, scalar) buffer Fits { Fit fits[]; };
layout(set = 0, binding = 7, scalar) readonly buffer GainKeys { uint gain_keys[]; };
layout(set = 0, binding = 8, scalar) buffer Gains { float gains[]; };
layout(set = 0, binding = 9, scalar) buffer GainSquares { float gain_squares[]; };

float gain_in(uint v, Candidate c, Fit fit) {
    View view = views[v];
    Sight s;
    if (!sees(v, view, c, s)) return 0.0;
    float alpha = fit.opacity * lobe_factor(s.theta, fit.width);
    if (!(alpha > 0.0)) return 0.0;
    float deviation = footprint_px(view, s.z, fit.sigma);
    Beneath under = look(plots[v], view, s.at, deviation);
    float left = 1.0 - float(explained[plots[v].pixel_first + s.pixel]) / WHOLE;
    vec3 r = 2.0 * left * under.difference, after = r - alpha * (fit.color - under.render);
    float area = PI * deviation * deviation, l = alpha / fit.opacity;
    float hidden = alpha * (4.0 * left * under.covariance + alpha * under.variance);
    // The residual left with the color that the other views ask for (leave-one-out); without other views
    // there is no prediction.
    float others = 1.0 - push.caution * area * l * l / fit.support;
    float here = dot(r, r) - dot(after, after) / (others * others) - hidden;
    if (!(others > 0.01)) here = min(dot(r, r) - dot(after, after) - hidden, 0.0);
    return area * here;
}

void main() {
    uint i = subgroup_index();
    if (i >= push.count) return;
    Fit fit = fits[i];
    bool is_open = fit.gain > 0.0 && gain_keys[i] == NONE;
    bool ends = is_open && push.begin != 0 && gains[i] <= 0.0; // of the round before
    float gain = push.begin != 0 ? 0.0 : gains[i], square = push.begin != 0 ? 0.0 : gain_squares[i];
    if (is_open && !ends) {
        Candidate c = candidates[i];
        for (uint first = push.view_first; first < push.view_end; first += gl_SubgroupSize) {
            uint v = first + gl_SubgroupInvocationID;
            float mine = v < push.view_end && shows(i, push.words, v) ? gain_in(v, c, fit) : 0.0;
            if (!subgroupAny(mine != 0.0)) continue;
            for (uint lane = 0; lane < gl_SubgroupSize; ++lane) {
                float here = subgroupShuffle(mine, lane);
                gain += here;
                square += here * here;
            }
        }
    }
    if (!subgroupElect()) return;
    if (ends) fits[i].gain = 0.0;
    gain_squares[i] = square;
    gains[i] = push.last != 0 ? gain - push.doubt * sqrt(square) : gain; // guard: pursuit: gains that few views tell
}

#version 460
// Finds the size, lobe width, opacity and color of each candidate with the largest gain over all views.
//
// One thread takes one candidate. sums, candidates -> fits, prices. The gain (see pursuit_score) is concave
// in the color and in the opacity alone, so each in turn is set to its optimum, ROUNDS times: color (A / o
// + B) / C within 0 to 1, opacity (c.A - D) / (E - 2 c.B + |c|^2 C) within OPACITY_MIN and OPACITY_MAX.
// A fit with a lobe and a plain one are compared by worth, gain over bytes, less `doubt` standard errors:
// that of a sum over views whose gains are proportional to a l^2. The gain of the best plain fit is stored
// too, for the plan of sizes.
// prices: what each would cost of a budget.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"

layout(push_constant, scalar) uniform Push {
    uint first, count;
    uint sizes;
    float first_size, size_ratio;
    float lobe_worth, plain_worth; // factor of a gain with a lobe and without; 0: do not try
    uint lobe_price, plain_price;
    float doubt; // standard errors subtracted from a gain
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Candidates { Candidate candidates[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Sums { float sums[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer Fits { Fit fits[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer Prices { uint prices[]; };

const float OPACITY_FIRST = 0.6, OPACITY_MIN = 0.1, OPACITY_MAX = 0.95;
const uint ROUNDS = 3;

void main() {
    uint k = thread_index(), items = push.count * push.sizes;
    if (k >= push.count) return;
    uint i = push.first + k;
    Candidate candidate = candidates[i];
    Fit best = Fit(0.0, 0.0, 0.0, vec3(0.0), 0.0, 0.0, 0.0);
    bool again = i > 0 && candidates[i - 1].view == candidate.view && candidates[i - 1].pixel == candidate.pixel;
    if (candidate.view != NONE && !again) {
        float most = 0.0, plain = 0.0;
        for (uint s = 0; s < push.sizes; ++s) {
            uint item = k * push.sizes + s;
            for (uint w = 0; w < WIDTHS; ++w) {
                float worth = w == WIDTHS - 1 ? push.plain_worth : push.lobe_worth;
                float x[SUMS];
                [[unroll]] for (uint q = 0; q < SUMS; ++q) x[q] = sums[(w * SUMS + q) * items + item];
                vec3 a = vec3(x[0], x[1], x[2]), b = vec3(x[3], x[4], x[5]), color = vec3(0.0);
                if (!(x[6] > 0.0)) continue;
                float opacity = OPACITY_FIRST;
                for (uint round = 0; round < ROUNDS; ++round) {
                    color = clamp((a / opacity + b) / x[6], vec3(0.0), vec3(1.0));
                    float bend = x[8] - 2.0 * dot(color, b) + dot(color, color) * x[6];
                    if (bend > 0.0) opacity = clamp((dot(color, a) - x[7]) / bend, OPACITY_MIN, OPACITY_MAX);
                }
                float gain = 2.0 * opacity * (dot(color, a) - x[7]) -
                             opacity * opacity * (x[8] - 2.0 * dot(color, b) + dot(color, color) * x[6]);
                if (!(gain <= FLOAT_MAX)) continue;
                if (w == WIDTHS - 1) plain = max(plain, gain);
                float counts = gain * worth * (1.0 - push.doubt * sqrt(x[9]) / x[6]);
                if (!(counts > most)) continue;
                most = counts;
                float size = push.first_size * pow(push.size_ratio, float(s));
                best = Fit(sigma_of(size, candidate.px), opacity, lobe_width(w, candidate.theta_bar), color, gain,
                           x[6], 0.0);
            }
        }
        best.plain = plain;
    }
    fits[i] = best;
    prices[i] = best.width > 0.0 ? push.lobe_price : push.plain_price;
}

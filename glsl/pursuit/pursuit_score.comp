#version 460
// Sums over the views of a page from which each candidate's best color, opacity and gain follow, for each
// size and lobe width.
//
// One thread takes one candidate and one size. views, plots, surface_depths, texels, candidates -> sums,
// which are added to: plane (width * SUMS + s) of item candidate * sizes + size. A page continues the sums of
// the page before, so the split into pages changes no rounding.
// With r photograph minus render, b the render, l the lobe's factor and q = exp(-d^2 / 2 s^2) the footprint, an opacity o and color c
// change the squared error of a view by -S (|r|^2 - |r - o l q (c - b)|^2) over its pixels. With a = pi s^2 and <x> the mean of x under q,
// S q x = 2 a <x>, and S q^2 x = a <x> as far as the mean under q^2 is the same. Summed over the views that see it the gain is
// 2 c.(o A + o^2 B) - |c|^2 o^2 C - 2 o D - o^2 E with A = S 2 a l <r>, B = S a l^2 <b>, C = S a l^2, D = S 2 a l <r.b>,
// E = S a l^2 <|b|^2>. The means of products account for the texture that a footprint hides. A tenth sum, S (a l^2)^2, tells over how
// many views the gain is spread.
#extension GL_GOOGLE_include_directive : require
#define PURSUIT_READS
#define PURSUIT_TEXELS 4
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"

layout(push_constant, scalar) uniform Push {
    uint first, count; // candidates
    uint sizes;
    float first_size, size_ratio; // px, in the view that a candidate was drawn in
    uint view_first, view_end;
    uint begin; // 1: the sums start at 0
} push;

layout(set = 0, binding = 5, scalar) buffer Sums { float sums[]; };

void main() {
    uint item = thread_index(), items = push.count * push.sizes;
    if (item >= items) return;
    Candidate c = candidates[push.first + item / push.sizes];
    float size = push.first_size * pow(push.size_ratio, float(item % push.sizes));
    float sigma = sigma_of(size, c.px);
    vec3 a[WIDTHS], b[WIDTHS], cde[WIDTHS];
    float squares[WIDTHS];
    [[unroll]] for (uint w = 0; w < WIDTHS; ++w) {
        squares[w] = push.begin != 0 ? 0.0 : sums[(w * SUMS + 9) * items + item];
        [[unroll]] for (uint q = 0; q < 3; ++q) {
            uint at = (w * SUMS + q) * items + item;
            a[w][q] = push.begin != 0 ? 0.0 : sums[at];
            b[w][q] = push.begin != 0 ? 0.0 : sums[at + 3 * items];
            cde[w][q] = push.begin != 0 ? 0.0 : sums[at + 6 * items];
        }
    }
    if (c.view != NONE) {
        for (uint v = push.view_first; v < push.view_end; ++v) {
            View view = views[v];
            Sight s;
            if (!sees(v, view, c, s)) continue;
            float deviation = footprint_px(view, s.z, sigma), area = PI * deviation * deviation;
            Beneath under = look(plots[v], view, s.at, deviation);
            vec3 r = 2.0 * under.difference;
            float r_b = dot(r, under.render) + 2.0 * under.covariance, b_b = dot(under.render, under.render) + under.variance;
            [[unroll]] for (uint w = 0; w < WIDTHS; ++w) {
                float l = lobe_factor(s.theta, lobe_width(w, c.theta_bar)), l1 = area * l, l2 = l1 * l;
                a[w] += l1 * r;
                b[w] += l2 * under.render;
                cde[w] += vec3(l2, l1 * r_b, l2 * b_b);
                squares[w] += l2 * l2;
            }
        }
    }
    [[unroll]] for (uint w = 0; w < WIDTHS; ++w) {
        sums[(w * SUMS + 9) * items + item] = squares[w];
        [[unroll]] for (uint q = 0; q < 3; ++q) {
            uint at = (w * SUMS + q) * items + item;
            sums[at] = a[w][q];
            sums[at + 3 * items] = b[w][q];
            sums[at + 6 * items] = cde[w][q];
        }
    }
}

// The pixels that a 2D Gaussian of the screen phase covers, and its weight at each.
//
// S = Rot(angle) diag(s^2) Rot(angle)^T; it covers the pixels where
// alpha = min(0.99, opacity * exp(-1/2 d^T (S + 0.3 I)^-1 d)) >= 1/255. Drawing and pruning use its opacity compensated by
// sqrt(det S / det(S + 0.3 I)), lifting its opacity uncompensated (method, sections 3 and 4).

#include "splat.glsl" // ALPHA_MIN, ALPHA_MAX
#include "unit.glsl"  // FLOAT_MAX
#include "trig.glsl"

struct Footprint {
    vec2 centre;
    float l11, l12, l22; // (S + 0.3 I)^-1 = L^T L, upper triangular
    float opacity;       // sigmoid(logit), compensated or not
    uvec2 low;           // first pixel of the bounding box
    uvec2 size;          // of the bounding box; 0 if nothing is covered
};

// S as (S11, S12, S22), px^2.
vec3 screen_covariance(vec2 log_scale, float angle) {
    vec2 s = exp(log_scale);
    precise vec2 turn = cos_sin(angle);
    float c = turn.x, n = turn.y;
    precise vec2 v = s * s;
    precise vec3 covariance = vec3(c * c * v.x + n * n * v.y, c * n * (v.x - v.y), n * n * v.x + c * c * v.y);
    return covariance;
}

// `precise`, with all its parts: counting and writing points must take the same decisions.
Footprint make_footprint(vec2 centre, float logit, vec2 log_scale, float angle, uvec2 image, bool compensate) {
    precise Footprint f;
    f.centre = centre;
    f.low = uvec2(0);
    f.size = uvec2(0);
    vec3 s = screen_covariance(log_scale, angle);
    vec2 v = exp(2.0 * log_scale);
    float a = s.x + DILATION, c = s.z + DILATION;
    // det(S + 0.3 I) as a sum of positive terms, so that needles do not cancel.
    float whole = v.x * v.y + DILATION * (v.x + v.y) + DILATION * DILATION;
    f.l11 = sqrt(c / whole);
    f.l12 = -s.y / sqrt(c * whole);
    f.l22 = inversesqrt(c);
    f.opacity = (compensate ? sqrt(v.x * v.y / whole) : 1.0) / (1.0 + exp(-logit));
    if (!(f.opacity >= ALPHA_MIN) || !(max(abs(centre.x), abs(centre.y)) <= 1e9)) return f;
    // alpha >= 1/255 <=> |L d|^2 <= 2 ln(255*opacity): an ellipse with these half extents. floor and ceil
    // leave slack for rounding.
    precise vec2 reach = sqrt(2.0 * log(255.0 * f.opacity) * vec2(a, c));
    if (!(max(reach.x, reach.y) <= 1e9)) return f;
    precise vec2 first = floor(centre - reach - 0.5), last = ceil(centre + reach - 0.5);
    uvec2 low = uvec2(clamp(first, vec2(0.0), vec2(image)));
    uvec2 high = uvec2(clamp(last + 1.0, vec2(0.0), vec2(image)));
    if (high.x <= low.x || high.y <= low.y) return f;
    f.low = low;
    f.size = high - low;
    return f;
}

// alpha at a pixel, 0 if it is not covered. `precise` like make_footprint.
float footprint_weight(Footprint f, uvec2 pixel) {
    precise vec2 d = vec2(pixel) + 0.5 - f.centre;
    precise float u = f.l11 * d.x + f.l12 * d.y;
    precise float v = f.l22 * d.y;
    precise float power = -0.5 * (u * u + v * v);
    precise float alpha = f.opacity * exp(power);
    return alpha >= ALPHA_MIN ? min(ALPHA_MAX, alpha) : 0.0;
}

bool is_depth(float depth) {
    return depth > 0.0 && depth <= FLOAT_MAX; // guard: depths that are NaN or none
}

// The pixels that a 2D Gaussian of the screen phase covers, with which weight.
//
// A 2D Gaussian is a column of `screen_planes` (planes × stride): 0,1 centre (px), 2..4 rgb, 5 opacity logit, 6,7 log scale (px),
// 8 angle, 9 depth. S = Rot(angle) diag(s²) Rot(angle)ᵀ; it covers the pixels where
// α = min(0.99, opacity · exp(−½ δᵀ(S + 0.3 I)⁻¹δ)) ≥ 1/255. It is drawn, and pruned, with its opacity compensated by
// √(det S / det(S + 0.3 I)), and lifted with its opacity as it is (method, sections 3 and 4).

#include "splat.glsl" // ALPHA_MIN, ALPHA_MAX
#include "unit.glsl"  // FLOAT_MAX


struct Footprint {
    vec2 centre;
    float l11, l12, l22; // (S + 0.3 I)⁻¹ = LᵀL, upper triangular
    float opacity;       // σ(logit), compensated or not
    uvec2 low;           // first pixel of the bounding box
    uvec2 size;          // of the bounding box; 0 when nothing is covered
};

// S as (S11, S12, S22), px².
vec3 screen_covariance(vec2 log_scale, float angle) {
    vec2 s = exp(log_scale);
    float c = cos(angle), n = sin(angle);
    vec2 v = s * s;
    return vec3(c * c * v.x + n * n * v.y, c * n * (v.x - v.y), n * n * v.x + c * c * v.y);
}

Footprint make_footprint(vec2 centre, float logit, vec2 log_scale, float angle, uvec2 image, bool compensate) {
    Footprint f;
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
    // α ≥ 1/255 ⇔ |Lδ|² ≤ 2 ln(255·opacity): an ellipse with these half extents. floor and ceil leave the slack for rounding.
    vec2 reach = sqrt(2.0 * log(255.0 * f.opacity) * vec2(a, c));
    if (!(max(reach.x, reach.y) <= 1e9)) return f;
    uvec2 low = uvec2(clamp(floor(centre - reach - 0.5), vec2(0.0), vec2(image)));
    uvec2 high = uvec2(clamp(ceil(centre + reach - 0.5) + 1.0, vec2(0.0), vec2(image)));
    if (high.x <= low.x || high.y <= low.y) return f;
    f.low = low;
    f.size = high - low;
    return f;
}

// α at a pixel, 0 where it is not covered. `precise`: counting and writing points must take the same decisions.
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

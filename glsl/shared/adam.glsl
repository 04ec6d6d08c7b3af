// The step on the parameters of one Gaussian, Adam's (Kingma 2014) with the settings of 3DGS or Newton's; shared by project_backward,
// which steps as soon as it has a gradient, and adam, which steps on gradients of several views.
//
// The kernel has the model with MODEL_LOADS and MODEL_STORES and the bindings of the moments, and declares `push.rates`,
// `push.page_first` and NEWTON: second moments are curvatures.
#include "adam_one.glsl"
#include "packed.glsl"

layout(constant_id = 6) const bool PACKED = false; // the moments of plane p are plane p, both in one word
const uint MOMENTS = PACKED ? 1 : 2; // planes of what has both

const float WIDTH_MIN = 0.01, WIDTH_MAX = 1.0; // method, section 1
// exp(beta) from 1/7 to 2981: a lobe twice as blunt as the cosine's square root, and one of 2 degrees. Within these bounds
// exp(beta) * ln cos(psi/2) * any factor of the gradient stays below 1e9 wherever the factor itself is above 1/255.
const float SHARPNESS_MIN = -2.0, SHARPNESS_MAX = 8.0;
const float FREE = 1e30; // bound of a parameter that has none

// What the words of a plane's moments say, and the first of those that say it.
Moments moments_of(float first, float second) {
    return PACKED ? unpack_moments(floatBitsToUint(first)) : Moments(first, second);
}
float first_word(Moments m, uint plane, uint place) {
    return PACKED ? uintBitsToFloat(pack_moments(m, dither_of(push.page_first + place, plane, push.rates.step))) : m.first;
}

// Nothing moves, and of moments only curvatures.
bool probes() { return NEWTON && push.rates.probe != 0; }
// Of words that are not packed: a step of Newton's leaves curvatures alone, a probe the first moments.
bool writes_first() { return PACKED || !probes(); }
bool writes_second() { return !PACKED && (!NEWTON || probes()); }

float change_of(float g, float rate, inout Moments m, float c1, float c2) {
    if (!NEWTON) return adam(g, rate, m.first, m.second, c1, c2);
    if (!probes()) return newton(g, rate, push.rates.newton, m.first, m.second);
    m.second = curvature(g, m.second);
    return 0.0;
}

void step_geometry(uint p, uint moment, uint place, float g, float rate) {
    uint at = MOMENTS * moment * push.stride + place;
    Moments m = moments_of(geometry_moments[at], PACKED ? 0.0 : geometry_moments[at + push.stride]);
    float change = change_of(g, rate, m, push.rates.first_correction, push.rates.second_correction);
    if (!probes()) store_geometry(p, place, load_geometry(p, place) + change);
    if (writes_first()) geometry_moments[at] = first_word(m, p, place);
    if (writes_second()) geometry_moments[at + push.stride] = m.second;
}

// Newton's steps of harmonics beyond the constant go by its curvature, channel by channel (method, section 5), and have first moments
// alone: behind the constant's moments, a word for each channel, or one for three.
vec3 constant_curvature;

void step_band(uint k, uint place, vec3 value, vec3 g, float rate) {
    if (probes()) return;
    uint at = (PACKED ? 2 + k : 3 + 3 * k) * push.stride + place;
    vec3 first, roots = sqrt(constant_curvature);
    if (PACKED) {
        first = unpack_firsts(floatBitsToUint(sh_moments[at]), roots);
    } else {
        [[unroll]] for (uint c = 0; c < 3; ++c) first[c] = sh_moments[at + c * push.stride];
    }
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        float change = newton(g[c], rate, push.rates.newton, first[c], constant_curvature[c]);
        store_sh(3 * k + c, place, value[c] + change);
        if (!PACKED) sh_moments[at + c * push.stride] = first[c];
    }
    uint dither = dither_of(push.page_first + place, 3 * k, push.rates.step);
    if (PACKED) sh_moments[at] = uintBitsToFloat(pack_firsts(first, roots, dither));
}

// Three channels of coefficient `k`, from `value`, which was read before. The constant, k = 0, goes first.
void step_sh(uint k, uint place, vec3 value, vec3 g) {
    if (NEWTON && k > 0) {
        step_band(k, place, value, g, push.rates.sh);
        return;
    }
    float rate = k == 0 ? push.rates.dc : push.rates.sh;
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        uint p = 3 * k + c, at = MOMENTS * p * push.stride + place;
        Moments m = moments_of(sh_moments[at], PACKED ? 0.0 : sh_moments[at + push.stride]);
        constant_curvature[c] = m.second; // of the constant alone, where it is used
        float change = change_of(g[c], rate, m, push.rates.first_correction, push.rates.second_correction);
        if (!probes()) store_sh(p, place, value[c] + change);
        if (writes_first()) sh_moments[at] = first_word(m, p, place);
        if (writes_second()) sh_moments[at + push.stride] = m.second;
    }
}

void step_lobe(uint p, uint place, float g, float rate, float lo, float hi) {
    uint at = MOMENTS * p * push.stride + place;
    Moments m = moments_of(lobe_moments[at], PACKED ? 0.0 : lobe_moments[at + push.stride]);
    float change = change_of(g, rate, m, push.rates.lobe_first_correction, push.rates.lobe_second_correction);
    if (!probes()) store_lobe(p, place, clamp(load_lobe(p, place) + change, lo, hi));
    if (writes_first()) lobe_moments[at] = first_word(m, p, place);
    if (writes_second()) lobe_moments[at + push.stride] = m.second;
}

// The gradient of all but the colour.
struct Gradient {
    vec3 mean, log_scale;
    vec4 quat;
    float opacity;
    vec3 direction;
    float width, sharpness;
};

bool finite(float x) { return !isnan(x) && !isinf(x); }
bool finite(vec3 x) { return finite(x.x) && finite(x.y) && finite(x.z); }
bool finite(Gradient g) {
    return finite(g.mean) && finite(g.log_scale) && finite(g.quat.xyz) && finite(vec3(g.quat.w, g.opacity, g.width)) &&
           finite(g.direction) && finite(g.sharpness);
}

// To planes of gradients, bound where the moments are; plane GEOMETRY_PLANES counts the views that blend the Gaussian.
void add_geometry(uint p, uint place, float g) { geometry_moments[p * push.stride + place] += g; }
void add_lobe(uint p, uint place, float g) { lobe_moments[p * push.stride + place] += g; }
void add_gradient(Gradient g, bool blended, bool has_lobes, uint place) {
    for (uint c = 0; c < 3; ++c) {
        add_geometry(MEAN + c, place, g.mean[c]);
        add_geometry(LOG_SCALE + c, place, g.log_scale[c]);
    }
    for (uint c = 0; c < 4; ++c) add_geometry(QUAT + c, place, g.quat[c]);
    add_geometry(OPACITY, place, g.opacity);
    add_geometry(GEOMETRY_PLANES, place, float(blended));
    if (!has_lobes) return;
    for (uint c = 0; c < 3; ++c) add_lobe(LOBE_DIRECTION + c, place, g.direction[c]);
    add_lobe(LOBE_WIDTH, place, g.width);
    add_lobe(LOBE_SHARPNESS, place, g.sharpness);
}

void step_all(Gradient g, bool has_lobes, uint place) {
    StepRates r = push.rates;
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        step_geometry(MEAN + c, MEAN + c, place, g.mean[c], r.mean);
        step_geometry(LOG_SCALE + c, LOG_SCALE + c, place, g.log_scale[c], r.log_scale);
    }
    [[unroll]] for (uint c = 0; c < 4; ++c) step_geometry(QUAT + c, QUAT + c, place, g.quat[c], r.quat);
    step_geometry(OPACITY, OPACITY, place, g.opacity, r.opacity);
    if (!has_lobes) return;
    [[unroll]] for (uint c = 0; c < 3; ++c) step_lobe(LOBE_DIRECTION + c, place, g.direction[c], r.direction, -FREE, FREE);
    step_lobe(LOBE_WIDTH, place, g.width, r.width, WIDTH_MIN, WIDTH_MAX); // guard: bounds of T
    step_lobe(LOBE_SHARPNESS, place, g.sharpness, r.sharpness, SHARPNESS_MIN, SHARPNESS_MAX); // guard: bounds of β
}

// One optimiser step on the parameters of one Gaussian: Adam's (Kingma 2014) with the settings of 3DGS, or
// Newton's. Shared by project_backward, which steps as soon as it has a gradient, and adam, which steps on
// gradients of several views.
//
// The including kernel defines MODEL_LOADS and MODEL_STORES and the bindings of the moments, and declares
// `push.rates`, `push.page_first` and NEWTON. With NEWTON, second moments are curvatures.
#include "adam_one.glsl"
#include "packed.glsl"

layout(constant_id = 6) const bool PACKED = false; // both moments of plane p are packed into plane p, one word each
const uint MOMENTS = PACKED ? 1 : 2; // planes of moments for each plane of parameters

const float WIDTH_MIN = 0.01, WIDTH_MAX = 1.0; // method, section 1
// exp(beta) from 1/7, a lobe twice as blunt as the cosine's square root, to 2981, one of 2 degrees. Within
// these bounds exp(beta) * ln cos(psi/2) * any factor of the gradient stays below 1e9 if the factor itself is
// above 1/255.
const float SHARPNESS_MIN = -2.0, SHARPNESS_MAX = 8.0;
const float FREE = 1e30; // bound of an unbounded parameter

// Moments from the words of a plane, and the first of these words from moments.
Moments moments_of(float first, float second) {
    return PACKED ? unpack_moments(floatBitsToUint(first)) : Moments(first, second);
}
float first_word(Moments m, uint plane, uint place) {
    return PACKED ? uintBitsToFloat(pack_moments(m, dither_of(push.page_first + place, plane, push.rates.step))) : m.first;
}

// A probe moves no parameter and updates only curvatures.
bool probes() { return NEWTON && push.rates.probe != 0; }
// If moments are not packed, a Newton step leaves curvatures unchanged, and a probe leaves first moments
// unchanged.
bool writes_first() { return PACKED || !probes(); }
bool writes_second() { return !PACKED && (!NEWTON || probes()); }

// A Newton step goes PACE times as far if the step before did not move the Gaussian: it has fewer steps. Four
// times as far diverges in a scene of which a view shows a small part (docs/experiments/2026-11-29-large.md).
const float PACE = 2.0;
float pace = 1.0;
float newton_step(float g, float rate, inout float m, float d) {
    return newton(g, pace * rate, pace * push.rates.newton, m, d);
}

// Place of LAST_STEP.
uint last_step_at(uint place) { return MOMENTS * (LAST_STEP / 4) * push.stride + place; }

float change_of(float g, float rate, inout Moments m, float c1, float c2) {
    if (!NEWTON) return adam(g, rate, m.first, m.second, c1, c2);
    if (!probes()) return newton_step(g, rate, m.first, m.second);
    m.second = curvature(g, m.second);
    return 0.0;
}

// Returns the change of one number of plane `p` and updates the words of its moments.
float step_one(uint p, uint place, float g, float rate, vec2 corrections, inout float first, inout float second) {
    Moments m = moments_of(first, second);
    float change = change_of(g, rate, m, corrections.x, corrections.y);
    first = first_word(m, p, place);
    second = m.second;
    return change;
}
// Does step_one for the four numbers of quad `q`, whose words are in `first` and `second`.
vec4 step_four(uint q, uint place, vec4 g, vec4 rate, vec2 corrections, inout vec4 first, inout vec4 second) {
    vec4 change;
    [[unroll]] for (uint c = 0; c < 4; ++c) change[c] = step_one(4 * q + c, place, g[c], rate[c], corrections, first[c], second[c]);
    return change;
}

void step_geometry(uint q, uint place, vec4 g, vec4 rate) {
    vec2 corrections = vec2(push.rates.first_correction, push.rates.second_correction);
    uint at = MOMENTS * q * push.stride + place;
    vec4 first = geometry_moments[at], second = PACKED ? vec4(0.0) : geometry_moments[at + push.stride];
    vec4 change = step_four(q, place, g, rate, corrections, first, second);
    if (!probes()) geometry[q * push.stride + place] += change;
    if (writes_first()) geometry_moments[at] = first;
    if (writes_second()) geometry_moments[at + push.stride] = second;
}

// Steps a Gaussian that learns only its opacity: both moments are in one quad, or in its first word.
void step_opacity(uint place, float g) {
    vec2 corrections = vec2(push.rates.first_correction, push.rates.second_correction);
    float first = geometry_moments[place].x, second = geometry_moments[place].y;
    float change = step_one(OPACITY, place, g, push.rates.opacity, corrections, first, second);
    store_geometry(OPACITY, place, load_geometry(OPACITY, place) + change);
    geometry_moments[place].x = first;
    if (!PACKED) geometry_moments[place].y = second;
}

// Newton steps of harmonics use the curvature of the constant coefficient, channel by channel (method,
// section 5). If moments are not packed, quad 0 of `sh_moments` is that curvature, and quad q + 1 the first
// moments of quad q. If they are, planes 0 to 2 are the words of the constant, and plane 2 + k the three
// first moments of coefficient k.
vec3 constant_curvature;

// Reads the constant's curvature of the Gaussian at `place`, before a step has done so.
vec3 known_curvature(uint place) {
    vec3 known = sh_moments[place].xyz;
    if (PACKED) [[unroll]] for (uint c = 0; c < 3; ++c) known[c] = unpack_moments(floatBitsToUint(known[c])).second;
    return known;
}

// Returns the change of coefficient `k` and updates its packed words.
vec3 step_packed(uint k, uint place, vec3 g) {
    vec3 change;
    if (k == 0) {
        [[unroll]] for (uint c = 0; c < 3; ++c) {
            float word = sh_moments[place][c], second = 0.0;
            constant_curvature[c] = moments_of(word, second).second;
            change[c] = step_one(c, place, g[c], push.rates.dc, vec2(1.0), word, second);
            sh_moments[place][c] = word;
        }
        return change;
    }
    uint at = quad_of(2 + k, place), word = (2 + k) % 4;
    vec3 roots = sqrt(constant_curvature), first = unpack_firsts(floatBitsToUint(sh_moments[at][word]), roots);
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        change[c] = newton_step(g[c], push.rates.sh, first[c], constant_curvature[c]);
    }
    uint dither = dither_of(push.page_first + place, 3 * k, push.rates.step);
    sh_moments[at][word] = uintBitsToFloat(pack_firsts(first, roots, dither));
    return change;
}

// Steps coefficients 4g to 4g + 3. `values` are their parameters, read earlier. Group 0 goes first, since it
// sets the curvature.
void step_sh12(uint g, uint place, vec4 values[3], vec4 grads[3]) {
    if (NEWTON && !PACKED && g == 0) {
        constant_curvature = sh_moments[place].xyz;
        if (probes()) {
            [[unroll]] for (uint c = 0; c < 3; ++c) sh_moments[place][c] = curvature(grads[0][c], constant_curvature[c]);
        }
    }
    if (NEWTON && PACKED) {
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            uint k = 4 * g + j;
            if (k >= COEFFICIENTS || (k > 0 && probes())) continue;
            vec3 change = step_packed(k, place, coefficient_of(grads, j));
            set_coefficient(values, j, coefficient_of(values, j) + change);
        }
    }
    if (NEWTON && probes()) return;
    [[unroll]] for (uint n = 0; n < 3; ++n) {
        uint q = 3 * g + n;
        if (4 * q >= 3 * COEFFICIENTS) continue;
        vec4 rate = vec4(q == 0 ? vec3(push.rates.dc) : vec3(push.rates.sh), push.rates.sh);
        if (NEWTON && !PACKED) {
            uint at = (q + 1) * push.stride + place;
            vec4 first = sh_moments[at];
            [[unroll]] for (uint c = 0; c < 4; ++c) {
                values[n][c] += newton_step(grads[n][c], rate[c], first[c], constant_curvature[(4 * n + c) % 3]);
            }
            sh_moments[at] = first;
        } else if (!NEWTON) {
            vec2 corrections = vec2(push.rates.first_correction, push.rates.second_correction);
            uint at = MOMENTS * q * push.stride + place;
            vec4 first = sh_moments[at], second = PACKED ? vec4(0.0) : sh_moments[at + push.stride];
            values[n] += step_four(q, place, grads[n], rate, corrections, first, second);
            sh_moments[at] = first;
            if (!PACKED) sh_moments[at + push.stride] = second;
        }
        [[unroll]] for (uint c = 0; c < 4; ++c) {
            // guard: bounds of b
            if (HAS_BETAS && is_beta_b(4 * q + c)) values[n][c] = clamp(values[n][c], BETA_MIN, BETA_MAX);
        }
        sh[q * push.stride + place] = values[n];
    }
}

void step_lobe(uint q, uint place, vec4 g, vec4 rate, vec4 lo, vec4 hi) {
    vec2 corrections = vec2(push.rates.lobe_first_correction, push.rates.lobe_second_correction);
    uint at = MOMENTS * q * push.stride + place;
    vec4 first = lobe_moments[at], second = PACKED ? vec4(0.0) : lobe_moments[at + push.stride];
    vec4 change = step_four(q, place, g, rate, corrections, first, second);
    if (!probes()) lobes[q * push.stride + place] = clamp(lobes[q * push.stride + place] + change, lo, hi);
    if (writes_first()) lobe_moments[at] = first;
    if (writes_second()) lobe_moments[at + push.stride] = second;
}

// Gradient by all parameters but the color's.
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

// Adds to the planes of gradients, which are bound in place of the moments. Plane GEOMETRY_PLANES counts the
// views that blend the Gaussian.
void add_gradient(Gradient g, bool blended, bool has_lobes, uint place) {
    geometry_moments[place] += vec4(g.mean, g.opacity);
    geometry_moments[push.stride + place] += g.quat;
    geometry_moments[2 * push.stride + place] += vec4(g.log_scale, float(blended));
    if (!has_lobes) return;
    lobe_moments[place] += vec4(g.direction, g.width);
    lobe_moments[push.stride + place].x += g.sharpness;
}

// Reads parameters again instead of taking them as arguments: kernels have few registers left here.
void step_all(Gradient g, bool has_lobes, uint place) {
    StepRates r = push.rates;
    step_geometry(MEAN / 4, place, vec4(g.mean, g.opacity), vec4(vec3(r.mean), r.opacity));
    step_geometry(QUAT / 4, place, g.quat, vec4(r.quat));
    step_geometry(LOG_SCALE / 4, place, vec4(g.log_scale, 0.0), vec4(vec3(r.log_scale), 0.0));
    if (!has_lobes) return;
    // guard: bounds of T
    step_lobe(0, place, vec4(g.direction, g.width), vec4(vec3(r.direction), r.width), vec4(vec3(-FREE), WIDTH_MIN), vec4(vec3(FREE), WIDTH_MAX));
    // guard: bounds of β
    step_lobe(1, place, vec4(g.sharpness, vec3(0.0)), vec4(r.sharpness, vec3(0.0)), vec4(SHARPNESS_MIN, vec3(-FREE)), vec4(SHARPNESS_MAX, vec3(FREE)));
}

#version 460
// Turns intersection records into gradients of 2D Gaussians, and takes the Adam step on them in the same
// pass.
//
// One thread takes one slot and sums its records, see shared/records.glsl.
// records, first_slot, tile_counts, screen_frames, screen_states, frames -> screen_planes, screen_ages, screen_moments
// With GRADIENTS it writes the gradients to the planes of the first moments instead and changes nothing else.
// Rates and clamps: method, section 3. Adam (Kingma 2014); the bias correction counts each Gaussian's own
// steps, as new ones start with moments of zero.
// Limits: a Gaussian whose gradient is not finite is not changed. Nothing changes once status says that a
// step did not fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/frame.glsl"
#include "../shared/status.glsl"
#include "../shared/screen.glsl"

layout(constant_id = 1) const bool GRADIENTS = false; // write gradients instead of stepping

layout(push_constant, scalar) uniform Push {
    uint count;  // slots
    uint stride; // of the planes of screen_planes and screen_moments
    uint by_gaussian; // records are by Gaussian, added up already
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 2, scalar) readonly buffer ScreenFrames { uint screen_frames[]; };
layout(set = 0, binding = 3, scalar) readonly buffer ScreenStates { ScreenState screen_states[]; };
layout(set = 0, binding = 4, scalar) readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 5, scalar) readonly buffer FirstSlot { uint first_slot[]; };
#define RECORD_CENTRES 6
#define RECORD_SHAPES 7
#define RECORD_COLORS 8
#include "../shared/records.glsl"
layout(set = 0, binding = 9, scalar) buffer ScreenPlanes { float screen_planes[]; };
layout(set = 0, binding = 10, scalar) buffer ScreenAges { uint screen_ages[]; };
layout(set = 0, binding = 11, scalar) buffer ScreenMoments { float screen_moments[]; };

const float RATE_CENTRE = 0.001; // times the mean of width and height
const float RATE_COLOR = 0.01, RATE_LOGIT = 0.02, RATE_LOG_SCALE = 0.001, RATE_ANGLE = 0.02;
const float BETA1 = 0.9, EPSILON = 1e-15;
const float BETA2 = 0.999, LOG_BETA1 = -0.105360515657826, LOG_BETA2 = -0.00100050033358353;
const float GRADIENT_MAX = 1e17; // its square, times the correction of 1000, is within float32

float at(uint p, uint i) { return screen_planes[p * push.stride + i]; }

// 1 - exp(x) for x <= 0: near 0 by a series (the next term is below 1e-7 of the sum), since 1 - exp(x) keeps
// few digits there.
float one_minus_exp(float x) {
    return x > -0.1 ? -x * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x / 120.0)))) : 1.0 - exp(x);
}

void step_one(uint p, uint i, float g, float rate, float c1, float c2, float lo, float hi) {
    uint first = 2 * p * push.stride + i, second = first + push.stride;
    if (GRADIENTS) {
        screen_moments[first] = g;
        return;
    }
    g = clamp(g, -GRADIENT_MAX, GRADIENT_MAX); // guard: 2D: gradients above 1e17
    // Not mix(), see mean_with() of adam_one.glsl.
    float m = (1.0 - BETA1) * g + BETA1 * screen_moments[first], v = (1.0 - BETA2) * g * g + BETA2 * screen_moments[second];
    screen_moments[first] = m;
    screen_moments[second] = v;
    float moved = at(p, i) - rate * (m / c1) / (sqrt(v / c2) + EPSILON);
    // The ellipse is the same after half a turn; the angle is kept near 0, so that sine and cosine are exact.
    if (p == ANGLE) moved -= PI * round(moved / PI); // guard: 2D: angles near 0
    screen_planes[p * push.stride + i] = clamp(moved, lo, hi); // guard: 2D: bounds of a step
}

bool finite(float x) { return !isnan(x) && !isinf(x); }

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    if (!GRADIENTS && status[STATUS_FAILED] != 0) return; // guard: no 2D step after an overflow
    uint f = screen_frames[i];
    if (f == NONE || screen_states[f].mode == WAITING) return;

    float record[RECORD];
    [[unroll]] for (uint r = 0; r < RECORD; ++r) record[r] = 0.0;
    uvec2 own = records_of(i);
    for (uint slot = own.x; slot < own.x + own.y; ++slot) add_record(slot, true, record);
    vec2 w = vec2(record[0], record[1]);
    float d_opacity = record[2];
    vec3 ww = vec3(record[3], record[4], record[5]), d_rgb = vec3(record[6], record[7], record[8]);

    ScreenShape e = screen_shape(vec2(at(LOG_SCALE, i), at(LOG_SCALE + 1, i)), at(ANGLE, i));
    float sigma = 1.0 / (1.0 + exp(-at(LOGIT, i)));
    float g[LEARNED];
    g[CENTRE] = e.l11 * w.x;
    g[CENTRE + 1] = e.l12 * w.x + e.l22 * w.y;
    g[COLOR] = d_rgb.r;
    g[COLOR + 1] = d_rgb.g;
    g[COLOR + 2] = d_rgb.b;
    // 1 - sigmoid(x) as sigmoid(-x): from a logit of 17 on the difference is 0 in float32.
    g[LOGIT] = d_opacity * e.compensation * sigma / (1.0 + exp(at(LOGIT, i))); // guard: slope of a high 2D opacity
    // d/dSigma2D = L^T W L / 2 with W = sum g w w^T. Along the axes p, q of S = v1 p p^T + v2 q q^T this is
    // d/dv1 = (Lp)^T W (Lp) / 2, and turning p into q by d angle gives (v1 - v2) (Lp)^T W (Lq).
    vec2 p = vec2(e.l11 * e.cosine + e.l12 * e.sine, e.l22 * e.sine);
    vec2 q = vec2(e.l12 * e.cosine - e.l11 * e.sine, e.l22 * e.cosine);
    vec2 wp = vec2(ww.x * p.x + ww.y * p.y, ww.y * p.x + ww.z * p.y);
    vec2 wq = vec2(ww.x * q.x + ww.y * q.y, ww.y * q.x + ww.z * q.y);
    // The compensation is a product of sqrt(v / (v + 0.3)): its logarithm grows by 0.3 / (v + 0.3) with each
    // log scale.
    vec2 growth = d_opacity * sigma * e.compensation * DILATION / (e.variance + DILATION);
    g[LOG_SCALE] = e.variance.x * dot(p, wp) + growth.x;
    g[LOG_SCALE + 1] = e.variance.y * dot(q, wq) + growth.y;
    g[ANGLE] = (e.variance.x - e.variance.y) * dot(p, wq);
    for (uint k = 0; k < LEARNED; ++k) {
        if (!finite(g[k])) return; // guard: 2D: NaN gradients
    }

    Frame frame = frames[f];
    uint age = screen_ages[i] + 1;
    if (!GRADIENTS) screen_ages[i] = age;
    float c1 = one_minus_exp(float(age) * LOG_BETA1), c2 = one_minus_exp(float(age) * LOG_BETA2);
    float width = float(frame.width), height = float(frame.height), huge = 1e30;
    float rate_centre = RATE_CENTRE * 0.5 * (width + height);
    float log_scale_max = log(scale_max(frame.width, frame.height));
    step_one(CENTRE, i, g[CENTRE], rate_centre, c1, c2, 0.0, width);
    step_one(CENTRE + 1, i, g[CENTRE + 1], rate_centre, c1, c2, 0.0, height);
    for (uint c = 0; c < 3; ++c) step_one(COLOR + c, i, g[COLOR + c], RATE_COLOR, c1, c2, 0.0, 1.0);
    step_one(LOGIT, i, g[LOGIT], RATE_LOGIT, c1, c2, -huge, huge);
    for (uint k = 0; k < 2; ++k) {
        step_one(LOG_SCALE + k, i, g[LOG_SCALE + k], RATE_LOG_SCALE, c1, c2, -huge, log_scale_max);
    }
    step_one(ANGLE, i, g[ANGLE], RATE_ANGLE, c1, c2, -huge, huge);
}

#version 460
// Turns copies into parents and children, and resets opacities.
//
// One thread takes one Gaussian of a page, at its new number. words, sources, copies, population, geometry,
// moments -> the same.
// MCMC (Kheradmand 2024): n equal Gaussians in one place, n at most COPIES, with opacities and scales such
// that together they look like the original. ADC (Kerbl 2023): a child is a copy of a small Gaussian; of a
// large one both are drawn from it, their scales over 1.6. BUDGET: splits it into two halves along its
// longest axis, which preserve its second moment there and its opacity in the middle.
// Moments of parents and children start at 0; an ADC clone's parent keeps its moments. Then opacities are
// clamped to `most`, with new moments if that lowers them.
// Scores restart at 0. Nothing changes once status says that the step did not fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/status.glsl"
#include "../shared/density.glsl"
#include "../shared/hash.glsl"

layout(constant_id = 1) const uint STRATEGY = MCMC;
layout(constant_id = 2) const uint SH_BESIDE = 6; // planes of moments of harmonics
layout(constant_id = 3) const uint MOMENTS = 2; // moment planes for each plane of the geometry

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first;
    uint stride;
    float small;  // ADC: largest scale that is cloned, scene units
    float most;   // largest opacity
    uint step;
    uint seed;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Words { uint words[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Sources { uint sources[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Copies { uint copies[]; };
#define GEOMETRY 5
#define GEOMETRY_MOMENTS 6
#define SH_MOMENTS 7
#define LOBE_MOMENTS 8
#define MODEL_LOADS
#define MODEL_STORES
#include "../shared/model.glsl"
layout(set = 0, binding = 9, scalar) writeonly buffer Scores { vec4 scores[]; };
#include "../shared/view.glsl"
#include "../shared/gaussian.glsl"

const uint COPIES = 51;
const float OPACITY_MIN = 0.005, OPACITY_MAX = 1.0 - 1.0 / 8388608.0;
const float SPLIT_SCALE = 1.6;             // ADC
const float HALF_SCALE = 0.70710678118654752; // BUDGET: of the longest axis
const float HALF_OPACITY = 0.70710678118654752; // BUDGET: exponent of the transmittance

// ln(x / (1 - x)), given 1 - x, which has more digits for a high opacity.
float logit_of(float x, float rest) { return log(x) - log(rest); }

void main() {
    uint place = thread_index();
    uint count = segment_first[push.segment + 1] - segment_first[push.segment];
    uint number = push.page_first + place;
    if (!(place < push.stride && number < count)) return;
    if (status[STATUS_FAILED] != 0) return;
    scores[place] = vec4(0.0);
    uint parent = sources[number], n = copies[parent] + 1;
    bool child = number >= words[ALIVE], fresh = n > 1;
    float logit = load_geometry(OPACITY, place), opacity = sigmoid(logit), rest = sigmoid(-logit);

    if (n > 1) {
        vec3 log_scale = load_geometry3(LOG_SCALE, place);
        if (STRATEGY == MCMC) {
            n = min(n, COPIES);
            float rest_new = pow(rest, 1.0 / float(n)), opacity_new = clamp(1.0 - rest_new, OPACITY_MIN, OPACITY_MAX);
            // sum over i = 1..n, k = 0..i-1 of C(i-1, k) (-1)^k o^(k+1) / sqrt(k+1) = sum over k of C(n, k+1)
            // (-1)^k ...: n alternating terms. Their sum is at least o, the part of i = 1.
            float sum = 0.0, term = 1.0;
            for (uint k = 0; k < n; ++k) {
                term *= float(n - k) / float(k + 1) * opacity_new;
                sum += (k % 2 == 0 ? term : -term) * inversesqrt(float(k + 1));
            }
            float by = log(opacity / max(sum, opacity_new));
            store_geometry3(LOG_SCALE, place, log_scale + by);
            logit = logit_of(opacity_new, 1.0 - opacity_new);
        } else {
            vec4 q = load_quat(place);
            to_unit(q);
            mat3 axes = rotation(q);
            vec3 mean = load_geometry3(MEAN, place);
            if (STRATEGY == ADC) {
                bool clone = max(max(log_scale.x, log_scale.y), log_scale.z) <= log(push.small);
                if (clone) {
                    fresh = child;
                } else {
                    vec3 off = exp(log_scale) * normal_of(pcg4d(uvec4(number, push.step, HASH_SPLIT, push.seed)));
                    store_geometry3(MEAN, place, mean + axes * off);
                    store_geometry3(LOG_SCALE, place, log_scale - log(SPLIT_SCALE));
                }
            } else {
                uint longest = log_scale.x >= log_scale.y && log_scale.x >= log_scale.z ? 0 : log_scale.y >= log_scale.z ? 1 : 2;
                float length_of = exp(log_scale[longest]) * sqrt(1.0 - HALF_SCALE * HALF_SCALE);
                store_geometry3(MEAN, place, mean + (child ? length_of : -length_of) * axes[longest]);
                vec3 ratio = exp(2.0 * (log_scale - log_scale[longest]));
                store_geometry3(LOG_SCALE, place, log_scale + log(1.0 - ratio * (1.0 - HALF_SCALE)));
                float rest_new = pow(rest, HALF_OPACITY);
                logit = logit_of(clamp(1.0 - rest_new, OPACITY_MIN, OPACITY_MAX), max(rest_new, 1.0 - OPACITY_MAX));
            }
        }
    }
    bool lowered = sigmoid(logit) > push.most;
    if (lowered) logit = logit_of(push.most, 1.0 - push.most);
    store_geometry(OPACITY, place, logit);
    if (lowered) {
        for (uint m = 0; m < MOMENTS; ++m) {
            geometry_moments[(MOMENTS * (OPACITY / 4) + m) * push.stride + place][OPACITY % 4] = 0.0;
        }
    }
    if (!fresh) return;
    for (uint q = 0; 4 * q < MOMENTS * GEOMETRY_PLANES; ++q) geometry_moments[q * push.stride + place] = vec4(0.0);
    for (uint q = 0; 4 * q < SH_BESIDE; ++q) sh_moments[q * push.stride + place] = vec4(0.0);
}

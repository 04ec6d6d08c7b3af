#version 460
// Moves means at random, fainter Gaussians more: the noise of 3DGS-MCMC (Kheradmand 2024).
//
// One thread takes one Gaussian of a page. population, geometry -> geometry: mean += Sigma (e sigmoid(100 ((1 - o) - 0.995))) rate,
// e three normal deviates hashed from (number, step, seed).
// Limits: a Gaussian whose noise is not finite does not move. Nothing changes once status says that the step
// did not fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/status.glsl"
#include "../shared/density.glsl"
#include "../shared/hash.glsl"

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first;
    uint stride;
    float rate;
    uint step;
    uint seed;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Status { uint status[]; };
#define GEOMETRY 2
#define MODEL_LOADS
#define MODEL_STORES
#include "../shared/model.glsl"
#include "../shared/view.glsl"
#include "../shared/gaussian.glsl"

const float STEEPNESS = 100.0, MIDDLE = 0.995;

void main() {
    uint place = thread_index();
    uint count = segment_first[push.segment + 1] - segment_first[push.segment];
    uint number = push.page_first + place;
    if (!(place < push.stride && number < count)) return;
    if (status[STATUS_FAILED] != 0) return;
    float logit = load_geometry(OPACITY, place);
    if (!(abs(logit) <= FLOAT_MAX)) return; // guard: density: noise that is finite
    float opacity = sigmoid(logit);
    float gate = push.rate * sigmoid(STEEPNESS * (1.0 - opacity - MIDDLE));
    vec4 q = load_quat(place);
    to_unit(q);
    mat3 axes = rotation(q);
    vec3 scale = exp(load_geometry3(LOG_SCALE, place));
    vec3 e = normal_of(pcg4d(uvec4(number, push.step, HASH_NOISE, push.seed)));
    vec3 off = axes * (scale * scale * (e * axes)) * gate;
    if (!(all(lessThanEqual(abs(off), vec3(FLOAT_MAX))))) return; // guard: density: noise that is finite
    store_geometry3(MEAN, place, load_geometry3(MEAN, place) + off);
}

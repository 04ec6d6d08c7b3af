#version 460
// Decides which Gaussians stay, and how likely each is to be drawn.
//
// One thread takes one Gaussian of a page. population, geometry, scores -> alive (1 or 0) and keys, by number
// in the segment.
// MCMC: alive above least_opacity. The key is a weight in proportion to the opacity, scaled so that the sum
// of `capacity` keys fits 32 bits.
// ADC: alive from least_opacity on. The key is 0 if the mean pull is at least least_score, else NONE.
// BUDGET: alive from least_opacity on. Keys are those of Efraimidis and Spirakis ("Weighted random sampling
// with a reservoir", 2006), the bits of -ln(1 - u) / score, NONE if the score is not above 0: the smallest
// keys are a sample without replacement.
// Limits: a Gaussian with a NaN opacity or scale is not alive.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/density.glsl"
#include "../shared/hash.glsl"

layout(constant_id = 1) const uint STRATEGY = MCMC;

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first;
    uint stride;
    uint capacity;       // maximum number of Gaussians
    float least_opacity;
    float least_score;
    uint step;
    uint seed;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
#define GEOMETRY 1
#define MODEL_LOADS
#include "../shared/model.glsl"
#include "../shared/view.glsl"
#include "../shared/gaussian.glsl"
layout(set = 0, binding = 2, scalar) readonly buffer Scores { vec4 scores[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer Alive { uint alive[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer Keys { uint keys[]; };

// Scores beyond these have no float32 for their quotient with a key.
const float SCORE_MIN = 1e-18, SCORE_MAX = 1e18;

void main() {
    uint place = thread_index();
    uint count = segment_first[push.segment + 1] - segment_first[push.segment];
    uint number = push.page_first + place;
    if (!(place < push.stride && number < count)) return;
    float opacity = sigmoid(load_geometry(OPACITY, place));
    vec3 log_scale = load_geometry3(LOG_SCALE, place);
    bool sized = all(lessThanEqual(abs(log_scale), vec3(FLOAT_MAX))); // guard: density: scales that are finite
    bool stays = sized && (STRATEGY == MCMC ? opacity > push.least_opacity : opacity >= push.least_opacity);
    uint key = STRATEGY == MCMC ? 0 : NONE;
    if (stays) {
        if (STRATEGY == MCMC) {
            key = uint(opacity * float(0xFFFFFFFFu / max(push.capacity, 1) / 2));
        } else if (STRATEGY == ADC) {
            float seen = scores[place][SEEN], pull = scores[place][PULL];
            if (seen > 0.0 && pull / seen >= push.least_score) key = 0;
        } else {
            float score = scores[place][ERROR];
            if (score >= SCORE_MIN && score <= SCORE_MAX) { // guard: density: scores that can be drawn
                uvec4 h = pcg4d(uvec4(number, push.step, HASH_KEY, push.seed));
                key = floatBitsToUint(exponential_of(h.x) / score);
            }
        }
    }
    alive[number] = uint(stays);
    keys[number] = key;
}

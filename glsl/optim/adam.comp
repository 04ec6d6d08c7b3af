#version 460
// One Adam step on gradients that project_backward has added up over the views of a step.
//
// One thread takes one Gaussian of a page. population, geometry_grads, sh_grads, lobe_grads, geometry, sh,
// lobes, moments -> geometry, sh, lobes, moments
// Gradients start each step at 0. Adam (Kingma 2014), or SparseAdam with SPARSE: Gaussians that no view
// blends do not step.
// Limits: a Gaussian whose gradient is not finite is not changed. Nothing changes once status says that a
// view did not fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/status.glsl"

layout(constant_id = 2) const bool HAS_LOBES = false;    // the segment is the supplement
layout(constant_id = 3) const bool OPACITY_ONLY = false; // geometry, color and lobes are frozen
layout(constant_id = 4) const bool SPARSE = false;       // skip Gaussians that no view of the step blends

const bool NEWTON = false;

#include "../shared/rates.glsl"

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first; // number in the segment of the page's first Gaussian
    uint stride;     // the page's capacity
    StepRates rates;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Status { uint status[]; };
#define GEOMETRY 2
#define SH 3
#define LOBES 4
#define GEOMETRY_MOMENTS 5
#define SH_MOMENTS 6
#define LOBE_MOMENTS 7
#define GEOMETRY_GRADS 8
#define SH_GRADS 9
#define LOBE_GRADS 10
#define MODEL_LOADS
#define MODEL_STORES
#include "../shared/model.glsl"
#include "../shared/unit.glsl"
#include "../shared/color.glsl"
#include "../shared/adam.glsl"

void main() {
    uint place = thread_index();
    uint i = segment_first[push.segment] + push.page_first + place; // Gaussian index
    if (place >= push.stride || i >= segment_first[push.segment + 1]) return;
    if (status[STATUS_FAILED] != 0) return;
    const uint VIEWS = OPACITY_ONLY ? 1 : GEOMETRY_PLANES; // plane
    if (SPARSE && geometry_grads[quad_of(VIEWS, place)][VIEWS % 4] == 0.0) return;
    if (OPACITY_ONLY) {
        float by_opacity = geometry_grads[place].x;
        if (finite(by_opacity)) step_opacity(place, by_opacity);
        return;
    }

    Gradient g;
    vec4 by_mean = geometry_grads[quad_of(MEAN, place)];
    g.mean = by_mean.xyz;
    g.opacity = by_mean.w;
    g.quat = geometry_grads[quad_of(QUAT, place)];
    g.log_scale = geometry_grads[quad_of(LOG_SCALE, place)].xyz;
    vec4 by_lobe = HAS_LOBES ? lobe_grads[quad_of(LOBE_DIRECTION, place)] : vec4(0.0);
    g.direction = by_lobe.xyz;
    g.width = by_lobe.w;
    g.sharpness = HAS_LOBES ? lobe_grads[quad_of(LOBE_SHARPNESS, place)].x : 0.0;
    bool sound = finite(g);
    // Read again below: all at once they would take 48 registers.
    [[dont_unroll]] for (uint q = 0; 4 * q < 3 * COEFFICIENTS; ++q) {
        vec4 grads = sh_grads[q * push.stride + place];
        sound = sound && finite(grads.xyz) && finite(grads.w);
    }
    if (!sound) return;

    // A vector normalised before it steps takes the gradient of its unit vector: longer by the vector's
    // length.
    if (any(notEqual(g.quat, vec4(0.0)))) {
        vec4 q = geometry[quad_of(QUAT, place)];
        float norm = to_unit(q);
        if (wants_unit(norm)) {
            store_quat(place, q);
            g.quat *= norm;
        }
    }
    if (HAS_LOBES && any(notEqual(g.direction, vec3(0.0)))) {
        vec4 axis = vec4(load_lobe_direction(place), 0.0);
        float norm = to_unit(axis);
        if (wants_unit(norm)) {
            store_lobe_direction(place, axis.xyz);
            g.direction *= norm;
        }
    }
    step_all(g, HAS_LOBES, place);
    [[unroll]] for (uint group = 0; group < GROUPS; ++group) {
        vec4 values[3], grads[3];
        load_sh12(group, 3 * COEFFICIENTS, place, values);
        [[unroll]] for (uint n = 0; n < 3; ++n) {
            uint q = 3 * group + n;
            grads[n] = 4 * q < 3 * COEFFICIENTS ? sh_grads[q * push.stride + place] : vec4(0.0);
        }
        step_sh12(group, place, values, grads);
    }
}

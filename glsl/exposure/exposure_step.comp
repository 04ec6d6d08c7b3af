#version 460
// Takes the Adam step of one photograph's map, then moves all maps so that their mean is the identity again.
//
// One workgroup. status, sums, maps, moments -> maps, moments
// Threads add up the sums of exposure_backward, and threads 0 to MAP - 1 step an entry each (Kingma 2014,
// bias correction by the steps of this photograph). Then the mean over all photographs of (M - I | b) is
// subtracted from each: a color that all photographs share belongs to the scene. All sums have a fixed
// order.
// Limits: a gradient that is not finite changes nothing. Nothing changes once status says that a step did not
// fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/status.glsl"
#include "../shared/exposure.glsl"
#include "../shared/adam_one.glsl"

layout(push_constant, scalar) uniform Push {
    uint photo;  // whose map steps
    uint photos; // number of maps
    uint runs;   // runs of SUM_PIXELS pixels in sums
    float rate;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Sums { float sums[]; };
layout(set = 0, binding = 2, scalar) buffer Maps { float maps[]; };
layout(set = 0, binding = 3, scalar) buffer Moments { float moments[]; };

// A subgroup has 8 lanes or more, a workgroup MAP threads or more.
shared float parts[MAP * (gl_WorkGroupSize.x / 8)];
shared float totals[MAP];
shared float stepped[MAP];

// Adds `part` up over the workgroup, into totals.
void add_up(float part[MAP]) {
    [[unroll]] for (uint e = 0; e < MAP; ++e) {
        float sum = subgroupAdd(part[e]);
        if (subgroupElect()) parts[MAP * gl_SubgroupID + e] = sum;
    }
    barrier();
    uint thread = gl_LocalInvocationIndex;
    if (thread < MAP) {
        float sum = 0.0;
        for (uint s = 0; s < gl_NumSubgroups; ++s) sum += parts[MAP * s + thread];
        totals[thread] = sum;
    }
    barrier();
}

// Entry e of the identity.
float identity(uint e) { return e % 5 == 0 ? 1.0 : 0.0; }

// Entry e of a map, after the step of its photograph.
float entry(uint photo, uint e) { return photo == push.photo ? stepped[e] : maps[MAP * photo + e]; }

void main() {
    if (group_index() != 0) return;
    if (status[STATUS_FAILED] != 0) return; // guard: exposure: no step after an overflow
    uint thread = gl_LocalInvocationIndex;
    float part[MAP];
    [[unroll]] for (uint e = 0; e < MAP; ++e) part[e] = 0.0;
    for (uint run = thread; run < push.runs; run += gl_WorkGroupSize.x) {
        [[unroll]] for (uint e = 0; e < MAP; ++e) part[e] += sums[MAP * run + e];
    }
    add_up(part);
    bool sound = true;
    for (uint e = 0; e < MAP; ++e) sound = sound && !isnan(totals[e]) && !isinf(totals[e]);
    if (!sound) return; // guard: exposure: gradients that are finite

    uint own = MOMENTS * push.photo;
    // Corrections after this step; thread 0 writes them once all have read the old ones.
    float c1 = mean_with(1.0, moments[own + CORRECTIONS], BETA1), c2 = mean_with(1.0, moments[own + CORRECTIONS + 1], BETA2);
    if (thread < MAP) {
        float m = moments[own + FIRST + thread], v = moments[own + SECOND + thread];
        stepped[thread] = maps[MAP * push.photo + thread] + adam(totals[thread], push.rate, m, v, 1.0 / c1, 1.0 / c2);
        moments[own + FIRST + thread] = m;
        moments[own + SECOND + thread] = v;
    }
    barrier();
    if (thread == 0) {
        moments[own + CORRECTIONS] = c1;
        moments[own + CORRECTIONS + 1] = c2;
    }

    [[unroll]] for (uint e = 0; e < MAP; ++e) part[e] = 0.0;
    for (uint photo = thread; photo < push.photos; photo += gl_WorkGroupSize.x) {
        [[unroll]] for (uint e = 0; e < MAP; ++e) part[e] += entry(photo, e) - identity(e);
    }
    add_up(part);
    for (uint photo = thread; photo < push.photos; photo += gl_WorkGroupSize.x) {
        for (uint e = 0; e < MAP; ++e) maps[MAP * photo + e] = entry(photo, e) - totals[e] / float(push.photos);
    }
}

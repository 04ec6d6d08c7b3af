#version 460
// Lifts behind the Gaussians that there are, closed up in the order of their 2D Gaussians.
//
// One thread: one 2D Gaussian.
// lifts, lift_ranks (exclusive scan of lift_flags) → geometry, sh, lobes: Gaussian gaussian_first + rank, lobe
// lobe_first + rank. DC from the lift, all other SH 0, sharpness 0. What would not fit into the strides is not written.

#extension GL_GOOGLE_include_directive : require

#include "../shared/common.glsl"
#include "../shared/lift.glsl"

layout(set = 0, binding = 0, scalar) readonly buffer Lifts { Lift lifts[]; };
layout(set = 0, binding = 1, scalar) readonly buffer LiftRanks { uint lift_ranks[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer Geometry { float geometry[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer Sh { float sh[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer Lobes { float lobes[]; };

layout(push_constant, scalar) uniform Push {
    uint count;           // 2D Gaussians (slots)
    uint gaussian_first;  // Gaussian index of the first lift: N + supplementary ones already there
    uint lobe_first;      // supplementary ones already there
    uint stride;          // of geometry and sh: capacity in Gaussians
    uint lobe_stride;     // of lobes: capacity in supplementary Gaussians
    uint sh_coefficients; // (L + 1)²
};

void main() {
    uint item = thread_index();
    if (item >= count) return;
    Lift lift = lifts[item];
    if (lift.cluster_size == 0) return;
    uint rank = lift_ranks[item];
    uint i = gaussian_first + rank;
    uint j = lobe_first + rank;
    if (i >= stride || j >= lobe_stride) return;
    for (uint k = 0; k < 3; k += 1) {
        geometry[k * stride + i] = lift.mean[k];
        geometry[(3 + k) * stride + i] = lift.log_scale[k];
        sh[k * stride + i] = lift.dc[k];
        lobes[k * lobe_stride + j] = lift.lobe_dir[k];
    }
    for (uint k = 0; k < 4; k += 1) geometry[(6 + k) * stride + i] = lift.quat[k];
    geometry[10 * stride + i] = lift.opacity;
    for (uint plane = 3; plane < 3 * sh_coefficients; plane += 1) sh[plane * stride + i] = 0.0;
    lobes[3 * lobe_stride + j] = lift.lobe_width;
    lobes[4 * lobe_stride + j] = 0.0;
}

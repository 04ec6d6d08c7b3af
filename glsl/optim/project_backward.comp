#version 460
// From intersection records to gradients of a Gaussian's parameters, and the Adam step on them in the same pass.
//
// One thread takes one Gaussian of first..first+count and sums its records, see shared/records.glsl.
// records, first_slot, tile_counts, views, geometry, sh, lobes, moments -> geometry, sh, lobes, moments
// With GRADIENTS it writes the gradients to *_moments instead (first plane of each pair) and changes nothing else.
// EWA backward as in 3DGS, in the whitened form of ARCHITECTURE.md; Adam (Kingma 2014), SparseAdam where SPARSE.
// Limits: a Gaussian whose gradient is not finite is left as it is. Nothing moves while status.overflow is raised.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/view.glsl"
#include "../shared/status.glsl"

layout(constant_id = 1) const bool COMPENSATE = false;   // as in project
layout(constant_id = 2) const bool LOBES = false;        // these Gaussians are supplementary
layout(constant_id = 3) const bool OPACITY_ONLY = false; // geometry, colour and lobes are frozen
layout(constant_id = 4) const bool SPARSE = false;       // leave Gaussians alone that this view does not blend
layout(constant_id = 5) const bool GRADIENTS = false;    // write gradients, do not step

layout(push_constant, scalar) uniform Push {
    uint first, count;         // the Gaussians of this dispatch
    uint stride;               // of the planes of geometry and sh
    uint moment_stride;        // of the planes of the moments, which begin at Gaussian `first`
    uint lobe_stride;          // of the planes of lobes, which begin at Gaussian `first`
    uint view;                 // index in views
    uint active_degree;        // SH bands evaluated
    uint stored_coefficients;  // SH coefficients stored, (L+1)^2
    float rate_mean, rate_log_scale, rate_quat, rate_opacity, rate_dc, rate_sh; // learning rates
    float rate_direction, rate_width, rate_sharpness;
    float first_correction, second_correction;           // 1/(1 - 0.9^t), 1/(1 - 0.999^t), or 1 and 1
    float lobe_first_correction, lobe_second_correction; // the same for lobes
    uint by_gaussian;          // records are by Gaussian, added up already
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Views { View views[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 2, scalar) readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 3, scalar) readonly buffer FirstSlot { uint first_slot[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Records { float records[]; };
layout(set = 0, binding = 5, scalar) buffer Geometry { float geometry[]; };
layout(set = 0, binding = 6, scalar) buffer Sh { float sh[]; };
layout(set = 0, binding = 7, scalar) buffer Lobes { float lobes[]; };
layout(set = 0, binding = 8, scalar) buffer GeometryMoments { float geometry_moments[]; };
layout(set = 0, binding = 9, scalar) buffer ShMoments { float sh_moments[]; };
layout(set = 0, binding = 10, scalar) buffer LobeMoments { float lobe_moments[]; };

#include "../shared/gaussian.glsl"
#include "../shared/records.glsl"

const float BETA1 = 0.9, BETA2 = 0.999, EPSILON = 1e-15;
const float WIDTH_MIN = 0.01, WIDTH_MAX = 1.0; // method, section 1
// exp(beta) from 1/7 to 2981: a lobe twice as blunt as the cosine's square root, and one of 2 degrees. Within these bounds
// exp(beta) * ln cos(psi/2) * any factor of the gradient stays below 1e9 wherever the factor itself is above 1/255.
const float SHARPNESS_MIN = -2.0, SHARPNESS_MAX = 8.0;

// The change that one Adam step makes; m and v are adjacent planes of a moment buffer.
// A gradient is cut off where its square, times 1/(1 - BETA2), would leave float32: v would stay infinite for ever. The step is at most
// (1 - BETA1) / sqrt((1 - BETA2) (1 - BETA1^2 / BETA2)) = 7.3 rates whatever the gradients (Cauchy and Schwarz).
const float GRADIENT_MAX = 1e17;
float adam(float g, float rate, inout float m, inout float v, float c1, float c2) {
    g = clamp(g, -GRADIENT_MAX, GRADIENT_MAX);
    m = mix(g, m, BETA1);
    v = mix(g * g, v, BETA2);
    return -rate * (m * c1) / (sqrt(v * c2) + EPSILON);
}

void step_geometry(uint p, uint i, float g, float rate) {
    uint at = 2 * p * push.moment_stride + (i - push.first);
    if (GRADIENTS) {
        geometry_moments[at] = g;
        return;
    }
    float m = geometry_moments[at], v = geometry_moments[at + push.moment_stride];
    geometry[p * push.stride + i] += adam(g, rate, m, v, push.first_correction, push.second_correction);
    geometry_moments[at] = m;
    geometry_moments[at + push.moment_stride] = v;
}

void step_sh(uint p, uint i, float g, float rate) {
    uint at = 2 * p * push.moment_stride + (i - push.first);
    if (GRADIENTS) {
        sh_moments[at] = g;
        return;
    }
    float m = sh_moments[at], v = sh_moments[at + push.moment_stride];
    sh[p * push.stride + i] += adam(g, rate, m, v, push.first_correction, push.second_correction);
    sh_moments[at] = m;
    sh_moments[at + push.moment_stride] = v;
}

void step_lobe(uint p, uint i, float g, float rate, float lo, float hi) {
    uint j = i - push.first, at = 2 * p * push.moment_stride + j;
    if (GRADIENTS) {
        lobe_moments[at] = g;
        return;
    }
    float m = lobe_moments[at], v = lobe_moments[at + push.moment_stride];
    float old = lobes[p * push.lobe_stride + j];
    lobes[p * push.lobe_stride + j] =
        clamp(old + adam(g, rate, m, v, push.lobe_first_correction, push.lobe_second_correction), lo, hi);
    lobe_moments[at] = m;
    lobe_moments[at + push.moment_stride] = v;
}

bool finite(float x) { return !isnan(x) && !isinf(x); }
bool finite(vec3 x) { return finite(x.x) && finite(x.y) && finite(x.z); }

const uint MANY = 256;
const uint UNROLL = 4;

// Of a record for the opacity alone, part 6 says that it is there.
bool is_read(uint r) { return !OPACITY_ONLY || r == 5 || r == 6; }

void add_slot(uint slot, inout float sums[RECORD]) {
    [[unroll]] for (uint r = 0; r < RECORD; ++r) {
        if (is_read(r)) sums[r] += records[slot * RECORD + r];
    }
}

void main() {
    uint i = push.first + thread_index();
    bool live = i < push.first + push.count;
    if (!GRADIENTS && status[STATUS_OVERFLOW] != 0) return;

    // Sums over the view's intersections. Of a Gaussian with more than MANY the whole subgroup sums, so that one which fills the
    // screen holds nobody up; UNROLL slots at a time, for llvmpipe ends a kernel's loops after 65,535 iterations of all of them
    // together: 8 lanes that each fill an image of 3840 x 2160 (129,600 tiles of 8 x 8) need 32,400.
    float record[RECORD];
    [[unroll]] for (uint r = 0; r < RECORD; ++r) record[r] = 0.0;
    uvec2 own = live ? records_of(i, push.by_gaussian != 0) : uvec2(0);
    uint slots = own.x, tiles = own.y;
    if (tiles <= MANY) {
        for (uint slot = slots; slot < slots + tiles; ++slot) add_slot(slot, record);
    }
    for (uvec4 left = subgroupBallot(tiles > MANY); any(notEqual(left, uvec4(0)));) {
        uint lane = subgroupBallotFindLSB(left);
        left[lane / 32] &= ~(1u << (lane % 32));
        uint begin = subgroupShuffle(slots, lane), end = begin + subgroupShuffle(tiles, lane);
        // Compensated (Kahan 1965): 16,200 equal terms drift by 2e-4 of their plain sum.
        precise float part[RECORD], lost[RECORD];
        [[unroll]] for (uint r = 0; r < RECORD; ++r) part[r] = lost[r] = 0.0;
        for (uint first = begin; first < end; first += UNROLL * gl_SubgroupSize) {
            float few[RECORD];
            [[unroll]] for (uint r = 0; r < RECORD; ++r) few[r] = 0.0;
            [[unroll]] for (uint k = 0; k < UNROLL; ++k) {
                uint slot = first + k * gl_SubgroupSize + gl_SubgroupInvocationID;
                if (slot < end) add_slot(slot, few);
            }
            [[unroll]] for (uint r = 0; r < RECORD; ++r) {
                precise float term = few[r] - lost[r];
                precise float sum = part[r] + term;
                lost[r] = (sum - part[r]) - term;
                part[r] = sum;
            }
        }
        [[unroll]] for (uint r = 0; r < RECORD; ++r) {
            if (!is_read(r)) continue;
            float total = subgroupAdd(part[r]);
            if (gl_SubgroupInvocationID == lane) record[r] = total;
        }
    }
    if (!live) return;
    float w_u = record[0], w_v = record[1], ww_uu = record[2], ww_uv = record[3], ww_vv = record[4], d_opacity = record[5];
    vec3 d_rgb = vec3(record[6], record[7], record[8]);
    // Blended: some derivative of this view's loss is not zero.
    bool blended = d_opacity != 0.0 || any(notEqual(d_rgb, vec3(0.0)));
    if (SPARSE && !blended) return;

    View view = views[push.view];
    float logit = plane(OPACITY, i), opacity = sigmoid(logit);
    vec3 d_mean = vec3(0.0), d_log_scale = vec3(0.0), d_colour = vec3(0.0), d_direction = vec3(0.0);
    vec4 d_quat = vec4(0.0);
    float d_logit = 0.0, d_width = 0.0, d_sharpness = 0.0;
    vec3 mean = plane3(MEAN, i), to_mean = vec3(0.0);

    if (blended) {
        vec3 p = to_camera(view, mean);
        vec4 q = vec4(plane(QUAT, i), plane3(QUAT + 1, i));
        float norm = to_unit(q);
        if (!OPACITY_ONLY && !GRADIENTS && wants_unit(norm)) {
            for (uint c = 0; c < 4; ++c) geometry[(QUAT + c) * push.stride + i] = q[c];
            norm = 1.0;
        }
        float factor = 1.0, compensation = 1.0;
        float range = length(mean - view.eye);
        to_mean = (mean - view.eye) / range;
        Projection e;
        if (COMPENSATE || !OPACITY_ONLY) e = project_covariance(view, p, q, exp(plane3(LOG_SCALE, i)));
        if (COMPENSATE) compensation = sqrt(e.det0 / e.det);
        if (LOBES) {
            uint j = i - push.first, s = push.lobe_stride;
            vec3 direction = vec3(lobes[j], lobes[s + j], lobes[2 * s + j]);
            float width = lobes[LOBE_WIDTH * s + j];
            Lobe lobe = eval_lobe(direction, width, lobes[LOBE_SHARPNESS * s + j], -to_mean);
            factor = lobe.factor;
            if (factor > 0.0) {
                if (!OPACITY_ONLY && !GRADIENTS && wants_unit(lobe.direction_length)) {
                    for (uint c = 0; c < 3; ++c) lobes[(LOBE_DIRECTION + c) * s + j] = lobe.axis[c];
                    lobe.direction_length = 1.0;
                }
                float d_factor = d_opacity * opacity * compensation;
                float common_part = d_factor * factor * lobe.exponent;
                d_sharpness = 2.0 * common_part * lobe.log_cos;
                d_width = common_part * tan(0.5 * lobe.psi) * lobe.psi / width;
                float turn = common_part / width * lobe.tan_over_sin;
                d_direction = turn * (lobe.v - lobe.cos_theta * lobe.axis) / lobe.direction_length;
                d_mean -= turn * (lobe.axis - lobe.cos_theta * lobe.v) / range;
            }
        }
        // 1 - sigmoid(x) as sigmoid(-x): from a logit of 17 on the difference is 0 in float32.
        d_logit = d_opacity * factor * compensation * opacity * sigmoid(-logit);

        if (!OPACITY_ONLY) {
            // Colour, clamped at 0 in the forward pass.
            uint coefficients = (push.active_degree + 1) * (push.active_degree + 1);
            float basis[16];
            sh_basis(to_mean, push.active_degree, basis);
            vec3 colour = vec3(0.5);
            for (uint k = 0; k < coefficients; ++k) colour += basis[k] * sh_at(k, i);
            d_colour = d_rgb * vec3(greaterThan(colour, vec3(0.0)));
            vec3 d_to_mean = vec3(0.0);
            for (uint k = 1; k < coefficients; ++k) d_to_mean += dot(d_colour, sh_at(k, i)) * sh_basis_gradient(to_mean, k);
            d_mean += (d_to_mean - to_mean * dot(to_mean, d_to_mean)) / range;

            // Centre and covariance: d/dSigma2D = L^T W L / 2 with W = sum g w w^T, d/dcentre = L^T sum g w. With N = L M (rows n1,
            // n2, of order 1) d/dM = L^T W N, and all that follows is written in N and L J W (rows j1, j2), not in M: a
            // needle's rows of M are long and nearly parallel, and their combinations would cancel.
            // n1 = l11 m1 + l12 m2 = (c m1 - b m2) / sqrt(c det), and m2 x (m1 x m2) = (m2.m2) m1 - b m2.
            float c = e.c + DILATION, root_c = inversesqrt(c), root_det = inversesqrt(e.det);
            float l22 = root_c, l11 = sqrt(c / e.det), l12 = -e.b * root_c * root_det;
            vec3 n1 = (cross(e.m2, e.n) + DILATION * e.m1) * root_c * root_det, n2 = root_c * e.m2;
            vec3 k1 = ww_uu * n1 + ww_uv * n2, k2 = ww_uv * n1 + ww_vv * n2;
            vec3 j1 = l11 * e.jw1 + l12 * e.jw2, j2 = l22 * e.jw2;
            // Component k of both rows of M is proportional to the k-th scale.
            d_log_scale = k1 * n1 + k2 * n2;
            // M = J W R S. d_axes[column][row]
            mat3 d_axes = outerProduct(j1, e.scale * k1) + outerProduct(j2, e.scale * k2);
            // J W's rows are fx/z (row_x - tx row_z) and fy/z (row_y - ty row_z), tx and ty clamped.
            vec3 along = e.scale * (view.row_z.xyz * e.axes);
            float a1 = dot(along, k1), a2 = dot(along, k2);
            vec2 d_t = vec2(l11 * a1, l12 * a1 + l22 * a2);
            if (COMPENSATE) {
                // ln compensation = ln(det0 / det) / 2; det0 = |n|^2, n = cof(S) R^T (jw1 x jw2). 1/det0 - 1/det is
                // (det - det0) / (det0 det), whose first difference is the dilation's part of det.
                float gain = d_opacity * opacity * factor * compensation / e.det;
                float sharp = gain * (DILATION * (e.a + e.c) + DILATION * DILATION), blunt = gain * DILATION;
                vec3 share = e.n * e.n / e.det0, turn = e.scale.yzx * e.scale.zxy * e.n / e.det0;
                d_log_scale += sharp * (share.yzx + share.zxy) - blunt * (e.m1 * e.m1 + e.m2 * e.m2);
                vec3 s1 = blunt * e.scale * e.m1, s2 = blunt * e.scale * e.m2;
                d_axes += outerProduct(cross(e.jw1, e.jw2), sharp * turn) - outerProduct(e.jw1, s1) - outerProduct(e.jw2, s2);
                vec3 world = sharp * (e.axes * turn);
                d_t += vec2(dot(cross(e.jw2, world) - e.axes * s1, view.row_z.xyz),
                            dot(cross(world, e.jw1) - e.axes * s2, view.row_z.xyz));
            }
            d_t *= -e.inv_z * vec2(view.fx, view.fy);

            float w = q.x, x = q.y, y = q.z, z = q.w;
            vec4 d_unit = 2.0 * vec4(
                z * (d_axes[0][1] - d_axes[1][0]) + y * (d_axes[2][0] - d_axes[0][2]) + x * (d_axes[1][2] - d_axes[2][1]),
                y * (d_axes[1][0] + d_axes[0][1]) + z * (d_axes[2][0] + d_axes[0][2]) + w * (d_axes[1][2] - d_axes[2][1]) -
                    2.0 * x * (d_axes[1][1] + d_axes[2][2]),
                x * (d_axes[1][0] + d_axes[0][1]) + z * (d_axes[2][1] + d_axes[1][2]) + w * (d_axes[2][0] - d_axes[0][2]) -
                    2.0 * y * (d_axes[0][0] + d_axes[2][2]),
                x * (d_axes[2][0] + d_axes[0][2]) + y * (d_axes[2][1] + d_axes[1][2]) + w * (d_axes[0][1] - d_axes[1][0]) -
                    2.0 * z * (d_axes[0][0] + d_axes[1][1]));
            d_quat = (d_unit - q * dot(q, d_unit)) / norm;

            // Nearer by a factor is larger by it, in every direction: the part of z is minus that of all log scales.
            float du = l11 * w_u, dv = l12 * w_u + l22 * w_v;
            vec2 d_xy = vec2(du * view.fx, dv * view.fy);
            vec3 d_p = vec3(d_xy, -dot(d_xy, p.xy) * e.inv_z - (d_log_scale.x + d_log_scale.y + d_log_scale.z));
            vec2 seen = abs(p.xy * e.inv_z);
            if (seen.x < view.limit_x) d_p += d_t.x * vec3(1.0, 0.0, -e.t.x);
            if (seen.y < view.limit_y) d_p += d_t.y * vec3(0.0, 1.0, -e.t.y);
            d_p *= e.inv_z;
            d_mean += d_p.x * view.row_x.xyz + d_p.y * view.row_y.xyz + d_p.z * view.row_z.xyz;
        }
    }

    if (OPACITY_ONLY) {
        // The only trained plane: its moments are planes 0 and 1.
        if (!finite(d_logit)) return;
        uint at = i - push.first;
        if (GRADIENTS) {
            geometry_moments[at] = d_logit;
            return;
        }
        float m = geometry_moments[at], v = geometry_moments[at + push.moment_stride];
        geometry[OPACITY * push.stride + i] +=
            adam(d_logit, push.rate_opacity, m, v, push.first_correction, push.second_correction);
        geometry_moments[at] = m;
        geometry_moments[at + push.moment_stride] = v;
        return;
    }

    if (!(finite(d_mean) && finite(d_log_scale) && finite(d_colour) && finite(d_direction) && finite(d_quat.xyz) &&
          finite(vec3(d_quat.w, d_logit, d_width)) && finite(d_sharpness)))
        return;
    float basis[16];
    sh_basis(to_mean, push.active_degree, basis);
    uint active_coefficients = (push.active_degree + 1) * (push.active_degree + 1);
    uint written = GRADIENTS ? push.stored_coefficients : active_coefficients;
    for (uint k = 0; k < written; ++k) {
        vec3 g = k < active_coefficients ? basis[k] * d_colour : vec3(0.0);
        float rate = k == 0 ? push.rate_dc : push.rate_sh;
        step_sh(3 * k, i, g.r, rate);
        step_sh(3 * k + 1, i, g.g, rate);
        step_sh(3 * k + 2, i, g.b, rate);
    }
    for (uint c = 0; c < 3; ++c) {
        step_geometry(MEAN + c, i, d_mean[c], push.rate_mean);
        step_geometry(LOG_SCALE + c, i, d_log_scale[c], push.rate_log_scale);
    }
    for (uint c = 0; c < 4; ++c) step_geometry(QUAT + c, i, d_quat[c], push.rate_quat);
    step_geometry(OPACITY, i, d_logit, push.rate_opacity);
    if (LOBES) {
        const float huge = 1e30;
        for (uint c = 0; c < 3; ++c)
            step_lobe(LOBE_DIRECTION + c, i, d_direction[c], push.rate_direction, -huge, huge);
        step_lobe(LOBE_WIDTH, i, d_width, push.rate_width, WIDTH_MIN, WIDTH_MAX);
        step_lobe(LOBE_SHARPNESS, i, d_sharpness, push.rate_sharpness, SHARPNESS_MIN, SHARPNESS_MAX);
    }
}

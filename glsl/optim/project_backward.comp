#version 460
// Turns intersection records into gradients of a Gaussian's parameters, and steps on them in the same pass.
//
// One thread takes one Gaussian of a page and sums its records, see shared/records.glsl.
// population, records, first_slot, tile_counts, splat_colors (by Gaussian index), views, geometry, sh, lobes, moments (by place)
// -> geometry, sh, lobes, moments
// With ACCUMULATE the gradients are added to their own planes, bound in place of the moments, and nothing
// else changes: `adam` steps once all views of the step are in. Plane GEOMETRY_PLANES counts the views that
// blend the Gaussian.
// With NEWTON, steps use the curvature estimated from the records of earlier loss_probes; a probe changes no
// parameter. Learners make both SPARSE.
// EWA backward as in 3DGS, in the whitened form of docs/design-notes.md; Adam (Kingma 2014), or SparseAdam
// with SPARSE.
// Limits: a Gaussian whose gradient is not finite is not changed. If only the products with very large
// coefficients make it so, the coefficients alone step. Nothing changes once status says that a step did not
// fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/population.glsl"
#include "../shared/view.glsl"
#include "../shared/status.glsl"

layout(constant_id = 1) const bool COMPENSATE = false;   // as in project
layout(constant_id = 2) const bool HAS_LOBES = false;    // the segment is the supplement
layout(constant_id = 3) const bool OPACITY_ONLY = false; // geometry, color and lobes are frozen
layout(constant_id = 4) const bool SPARSE = false;       // skip Gaussians that this view does not blend
layout(constant_id = 5) const bool ACCUMULATE = false;   // add gradients up, do not step
layout(constant_id = 7) const bool NEWTON = false;       // steps by curvature, estimated by probes

#include "../shared/rates.glsl"

layout(push_constant, scalar) uniform Push {
    uint segment;
    uint page_first;  // number in the segment of the page's first Gaussian
    uint stride;      // the page's capacity
    uint view;        // index in views
    uint by_gaussian; // records are by Gaussian, added up already
    StepRates rates;
    float mean_opacity, mean_scale; // weights in the loss of the mean over the segment's opacities and over its scales
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Views { View views[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 3, scalar) readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 4, scalar) readonly buffer FirstSlot { uint first_slot[]; };
#define RECORD_CENTRES 5
#define RECORD_SHAPES 6
#define RECORD_COLORS 7
#define RECORD_WORDS 15
#include "../shared/records.glsl"
layout(set = 0, binding = 8, scalar) readonly buffer SplatColors { vec3 splat_colors[]; };
#define GEOMETRY 9
#define SH 10
#define LOBES 11
#define GEOMETRY_MOMENTS 12
#define SH_MOMENTS 13
#define LOBE_MOMENTS 14
#define MODEL_LOADS
#define MODEL_STORES
#include "../shared/model.glsl"
#include "../shared/gaussian.glsl"
#include "../shared/color.glsl"
#include "../shared/adam.glsl"

#define SUMS RECORD
#include "../shared/sums.glsl"
void add(uint at, inout float sums[SUMS]) { add_record(at, !OPACITY_ONLY, sums); }

void main() {
    View view = views[push.view]; // as in project
    uint place = thread_index();
    uint all_first = segment_first[push.segment], all_end = segment_first[push.segment + 1];
    uint i = all_first + push.page_first + place; // Gaussian index
    bool live = place < push.stride && i < all_end;
    if (status[STATUS_FAILED] != 0) return; // guard: nothing moves after an overflow

    // Sums over the view's intersections.
    float record[RECORD];
    sum_over(live ? records_of(i) : uvec2(0), record);
    if (!live) return; // guard: lanes beyond the last Gaussian
    float w_u = record[0], w_v = record[1], d_opacity = record[2], ww_uu = record[3], ww_uv = record[4], ww_vv = record[5];
    vec3 d_rgb = vec3(record[6], record[7], record[8]);
    // Blended: some derivative of this view's loss is not zero, or the record says so.
    bool blended = d_opacity != 0.0 || (OPACITY_ONLY ? w_u != 0.0 : any(notEqual(d_rgb, vec3(0.0))));
    if (SPARSE && !blended) return;

    vec4 quads[3];
    [[unroll]] for (uint q = 0; q < 3; ++q) quads[q] = geometry[q * push.stride + place];
    float logit = quads[OPACITY / 4][OPACITY % 4], opacity = sigmoid(logit);
    Gradient g = Gradient(vec3(0.0), vec3(0.0), vec4(0.0), 0.0, vec3(0.0), 0.0, 0.0);
    vec3 d_color = vec3(0.0), to_mean = vec3(0.0), mean = quads[MEAN / 4].xyz, scale = exp(quads[LOG_SCALE / 4].xyz);
    float range = 1.0;

    if (blended) {
        vec3 p = to_camera(view, mean);
        vec4 q = quads[QUAT / 4];
        float norm = to_unit(q);
        if (!OPACITY_ONLY && !ACCUMULATE && wants_unit(norm)) { // guard: unit quaternion before a step
            store_quat(place, q);
            norm = 1.0;
        }
        float factor = 1.0, compensation = 1.0;
        range = length(mean - view.eye);
        to_mean = (mean - view.eye) / range;
        Projection e;
        if (COMPENSATE || !OPACITY_ONLY) e = project_covariance(view, p, q, scale);
        if (COMPENSATE) compensation = sqrt(e.det0 / e.det);
        if (HAS_LOBES) {
            float width = load_lobe(LOBE_WIDTH, place);
            Lobe lobe = eval_lobe(load_lobe_direction(place), width, load_lobe(LOBE_SHARPNESS, place), -to_mean);
            factor = lobe.factor;
            if (factor > 0.0) {
                // guard: unit direction before a step
                if (!OPACITY_ONLY && !ACCUMULATE && wants_unit(lobe.direction_length)) {
                    store_lobe_direction(place, lobe.axis);
                    lobe.direction_length = 1.0;
                }
                float d_factor = d_opacity * opacity * compensation;
                float common_part = d_factor * factor * lobe.exponent;
                g.sharpness = 2.0 * common_part * lobe.log_cos;
                g.width = common_part * lobe.tangent * lobe.psi / width;
                float turn = common_part / width * lobe.tan_over_sin;
                g.direction = turn * (lobe.v - lobe.cos_theta * lobe.axis) / lobe.direction_length;
                g.mean -= turn * (lobe.axis - lobe.cos_theta * lobe.v) / range;
            }
        }
        // 1 - sigmoid(x) as sigmoid(-x): from a logit of 17 on the difference is 0 in float32.
        g.opacity = d_opacity * factor * compensation * opacity * sigmoid(-logit); // guard: slope of a high opacity

        if (!OPACITY_ONLY) {
            // A channel clamped at 0 passes gradients that raise it; otherwise a Gaussian that is black from
            // every camera would stay black. A probe has no sign: it passes only while the channel's
            // curvature is unknown.
            bvec3 passes = probes() ? equal(known_curvature(place), vec3(0.0)) : lessThan(d_rgb, vec3(0.0));
            d_color = d_rgb * max(vec3(greaterThan(splat_colors[i], vec3(0.0))), vec3(passes)); // guard: dead colors

            // Centre and covariance: d/dSigma2D = L^T W L / 2 with W = sum g w w^T, d/dcentre = L^T sum g w. With N = L M (rows n1,
            // n2, of order 1) d/dM = L^T W N, and all that follows is written in N and L J W (rows j1, j2), not in M: a
            // needle's rows of M are long and nearly parallel, and their combinations would cancel.
            // n1 = l11 m1 + l12 m2 = (c m1 - b m2) / sqrt(c det), and m2 x (m1 x m2) = (m2.m2) m1 - b m2.
            float c = e.c + DILATION, root_c = inversesqrt(c), root_det = inversesqrt(e.det);
            float l22 = root_c, l11 = sqrt(c / e.det), l12 = -e.b * root_c * root_det;
            // guard: gradient of needles
            vec3 n1 = (cross(e.m2, e.n) + DILATION * e.m1) * root_c * root_det, n2 = root_c * e.m2;
            vec3 k1 = ww_uu * n1 + ww_uv * n2, k2 = ww_uv * n1 + ww_vv * n2;
            vec3 j1 = l11 * e.jw1 + l12 * e.jw2, j2 = l22 * e.jw2;
            // Component k of both rows of M is proportional to the k-th scale.
            g.log_scale = k1 * n1 + k2 * n2;
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
                g.log_scale += sharp * (share.yzx + share.zxy) - blunt * (e.m1 * e.m1 + e.m2 * e.m2);
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
            g.quat = (d_unit - q * dot(q, d_unit)) / norm;

            // A Gaussian nearer by a factor appears larger by it in every direction: the z part is minus the
            // sum over all log scales.
            float du = l11 * w_u, dv = l12 * w_u + l22 * w_v;
            vec2 d_xy = vec2(du * view.fx, dv * view.fy);
            vec3 d_p = vec3(d_xy, -dot(d_xy, p.xy) * e.inv_z - (g.log_scale.x + g.log_scale.y + g.log_scale.z));
            vec2 slope = p.xy * e.inv_z;
            // guard: gradient where the Jacobian is clamped (2 lines)
            if (slope.x > view.slope_low.x && slope.x < view.slope_high.x) d_p += d_t.x * vec3(1.0, 0.0, -e.t.x);
            if (slope.y > view.slope_low.y && slope.y < view.slope_high.y) d_p += d_t.y * vec3(0.0, 1.0, -e.t.y);
            d_p *= e.inv_z;
            g.mean += d_p.x * view.row_x.xyz + d_p.y * view.row_y.xyz + d_p.z * view.row_z.xyz;
        }
    }

    if (OPACITY_ONLY) {
        // Its opacity is the only plane that learns, and has the first moments.
        if (!finite(g.opacity)) return; // guard: a base's NaN gradients
        if (!ACCUMULATE) {
            step_opacity(place, g.opacity);
        } else {
            geometry_moments[place].xy += vec2(g.opacity, float(blended));
        }
        return;
    }

    // Regularisers (Kheradmand 2024) apply to all Gaussians, including those that the view does not blend.
    float of_all = float(all_end - all_first);
    if (push.mean_opacity != 0.0) g.opacity += push.mean_opacity / of_all * opacity * sigmoid(-logit);
    if (push.mean_scale != 0.0) {
        g.log_scale += push.mean_scale / (3.0 * of_all) * scale;
    }
    if (!finite(g) || !finite(d_color)) return; // guard: NaN gradients
    // Reads each coefficient of harmonics once: for the gradient by the direction, and for its step.
    float last_step = 0.0, this_step = float(push.rates.step + 1);
    if (NEWTON) {
        last_step = geometry_moments[last_step_at(place)][LAST_STEP % 4];
        pace = last_step + 1.0 == this_step ? 1.0 : PACE;
    }
    ColorAt at = color_at(to_mean, place);
    vec3 d_to_mean = vec3(0.0);
    [[unroll]] for (uint group = 0; group < GROUPS; ++group) {
        vec4 values[3], grads[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
        load_sh12(group, 3 * COEFFICIENTS, place, values);
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            uint k = 4 * group + j;
            if (k >= COEFFICIENTS) continue;
            d_to_mean += direction_gradient(at, k, d_color, coefficient_of(values, j));
            set_coefficient(grads, j, coefficient_gradient(at, k, d_color));
        }
        if (!ACCUMULATE) {
            step_sh12(group, place, values, grads);
            continue;
        }
        [[unroll]] for (uint n = 0; n < 3; ++n) {
            uint q = 3 * group + n;
            if (4 * q < 3 * COEFFICIENTS) sh_moments[q * push.stride + place] += grads[n];
        }
    }
    if (blended) g.mean += (d_to_mean - to_mean * dot(to_mean, d_to_mean)) / range;
    if (!finite(g.mean)) return;
    if (ACCUMULATE) {
        add_gradient(g, blended, HAS_LOBES, place);
        return;
    }
    step_all(g, HAS_LOBES, place);
    if (NEWTON) geometry_moments[last_step_at(place)][LAST_STEP % 4] = probes() ? last_step : this_step;
}

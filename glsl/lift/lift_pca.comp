#version 460
// Computes the 3D Gaussian of each prime group: position, weighted PCA, calibration, color and lobe (method,
// section 4.3 to 4.6).
//
// One subgroup takes one 2D Gaussian. Its lanes share the sums over the points and the loop over the training
// views; every lane repeats the 3x3 algebra. Sums go lane by lane in point order and then over the lanes: the
// order is always the same.
//
// screen_planes, screen_frames, views, train_views, points, point_counts, point_firsts, heaviest, labels, prime_labels, cluster_sizes
// -> lifts, lift_flags (1 if there is a lift, else 0; lift_append takes their exclusive scan).
//
// Cases without a unique result: collinear or coincident points leave eigenvalues at the floor. Axes of equal
// eigenvalues are those that Jacobi's rotations leave, the camera's own if nothing was rotated. A third axis
// seen exactly edge-on keeps its sign. If a result cannot be finite (a 2D centre, depth or camera is not),
// there is no lift.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/view.glsl"
#include "../shared/footprint.glsl"
#include "../shared/screen.glsl"
#include "../shared/lift.glsl"

// ⚖ Weights of the covariance: 0, w^2 (the release); 1, w.
layout(constant_id = 1) const uint PLAIN_WEIGHTS = 0;

layout(set = 0, binding = 0, scalar) readonly buffer ScreenPlanes { float screen_planes[]; };
layout(set = 0, binding = 1, scalar) readonly buffer ScreenFrames { uint screen_frames[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Views { View views[]; };
// Indices of the training views. The source view may be among them and is skipped.
layout(set = 0, binding = 3, scalar) readonly buffer TrainViews { uint train_views[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 5, scalar) readonly buffer PointCounts { uint point_counts[]; };
layout(set = 0, binding = 6, scalar) readonly buffer PointFirsts { uint point_firsts[]; };
layout(set = 0, binding = 7, scalar) readonly buffer Heaviest { uint heaviest[]; };
layout(set = 0, binding = 8, scalar) readonly buffer Labels { uint labels[]; };
layout(set = 0, binding = 9, scalar) readonly buffer PrimeLabels { uint prime_labels[]; };
layout(set = 0, binding = 10, scalar) readonly buffer ClusterSizes { uint cluster_sizes[]; };
layout(set = 0, binding = 11, scalar) writeonly buffer Lifts { Lift lifts[]; };
layout(set = 0, binding = 12, scalar) writeonly buffer LiftFlags { uint lift_flags[]; };

layout(push_constant, scalar) uniform Push {
    uint count;       // 2D Gaussians, including empty slots
    uint stride;      // of the planes
    uint view_count;
    uint train_count;
    float unit;       // the scene's own length, scene units
} push;

float at(uint p, uint i) { return screen_planes[p * push.stride + i]; }

const float EIGENVALUE_MIN = 1e-7;       // unit^2
const uint SWEEPS = 8;                   // Jacobi on 3x3 converges quadratically: 4 reach float32, 6 float64, two to spare

// Annihilates the off-diagonal element pq; r is the third index. Entries are at most 1 (scaled by the trace),
// so elements below 1e-30 change nothing.
void turn(inout float pp, inout float qq, inout float pq, inout float rp, inout float rq, inout vec3 axis_p, inout vec3 axis_q) {
    if (!(abs(pq) > 1e-30)) return; // guard: rotations of nothing
    float ratio = (qq - pp) / (2.0 * pq);
    // Beyond 1e15 the square would overflow, and tan = 1/(2*ratio) is below all rounding.
    float tangent = abs(ratio) < 1e15 ? (ratio < 0.0 ? -1.0 : 1.0) / (abs(ratio) + sqrt(ratio * ratio + 1.0)) : 0.5 / ratio;
    float c = inversesqrt(tangent * tangent + 1.0), s = tangent * c;
    pp -= tangent * pq;
    qq += tangent * pq;
    pq = 0.0;
    float old_rp = rp;
    rp = c * old_rp - s * rq;
    rq = s * old_rp + c * rq;
    vec3 old_p = axis_p;
    axis_p = c * old_p - s * axis_q;
    axis_q = s * old_p + c * axis_q;
}

void order(inout float a, inout float b, inout vec3 axis_a, inout vec3 axis_b) {
    if (a >= b) return;
    float t = a;
    a = b;
    b = t;
    vec3 axis = axis_a;
    axis_a = axis_b;
    axis_b = axis;
}

// Unit quaternion (w, x, y, z) of the rotation whose columns are a, b, c (Shepperd: divide by the largest of the four).
vec4 quaternion(vec3 a, vec3 b, vec3 c) {
    float w = 1.0 + a.x + b.y + c.z, x = 1.0 + a.x - b.y - c.z, y = 1.0 - a.x + b.y - c.z, z = 1.0 - a.x - b.y + c.z;
    vec4 q;
    if (w >= x && w >= y && w >= z) q = vec4(w, b.z - c.y, c.x - a.z, a.y - b.x);
    else if (x >= y && x >= z) q = vec4(b.z - c.y, x, a.y + b.x, c.x + a.z);
    else if (y >= z) q = vec4(c.x - a.z, a.y + b.x, y, b.z + c.y);
    else q = vec4(a.y - b.x, c.x + a.z, b.z + c.y, z);
    return normalize(q);
}

vec3 to_world(View view, vec3 direction) {
    return view.row_x.xyz * direction.x + view.row_y.xyz * direction.y + view.row_z.xyz * direction.z;
}

bool is_finite(vec4 v) {
    vec4 a = abs(v);
    return a.x <= FLOAT_MAX && a.y <= FLOAT_MAX && a.z <= FLOAT_MAX && a.w <= FLOAT_MAX;
}

// The angle at `position` between the source camera (in direction `toward`) and the training camera closest
// in angle whose frustum contains the position; pi/2 if there is none.
float nearest_view_angle(vec3 position, vec3 toward, uint source) {
    float nearest = 4.0; // above pi
    for (uint k = gl_SubgroupInvocationID; k < push.train_count; k += gl_SubgroupSize) {
        uint v = train_views[k];
        if (v >= push.view_count || v == source) continue;
        View view = views[v];
        vec3 p = to_camera(view, position);
        if (!(p.z > NEAR)) continue;
        float x = view.fx * p.x / p.z + view.cx, y = view.fy * p.y / p.z + view.cy;
        if (!(x >= 0.0 && y >= 0.0 && x < float(view.width) && y < float(view.height))) continue;
        vec3 other = view.eye - position;
        nearest = min(nearest, angle_of(length(cross(toward, other)), dot(toward, other)));
    }
    nearest = subgroupMin(nearest);
    return nearest < 4.0 ? nearest : 0.5 * PI;
}

const Lift NO_LIFT = Lift(vec3(0.0), vec3(0.0), vec4(0.0), vec3(0.0), 0.0, vec3(0.0), 0.0, 0.0, 0u);

Lift make_lift(uint item, View view, uint source) {
    uint n = point_counts[item], first = point_firsts[item], prime = prime_labels[item];
    uint lane = gl_SubgroupInvocationID, width = gl_SubgroupSize;

    // The label is the group's first point; sums are taken from there, so that they do not cancel.
    vec3 origin = points[first + prime].xyz;
    vec4 sums = vec4(0.0); // sum w (x - origin), sum w
    for (uint i = lane; i < n; i += width) {
        if (labels[first + i] != prime) continue;
        vec4 p = points[first + i];
        sums += p.w * vec4(p.xyz - origin, 1.0);
    }
    sums = subgroupAdd(sums);
    vec3 centred_mean = sums.xyz / sums.w;

    vec3 diagonal = vec3(0.0), off = vec3(0.0); // xx, yy, zz and xy, xz, yz
    float total = 0.0;
    for (uint i = lane; i < n; i += width) {
        if (labels[first + i] != prime) continue;
        vec4 p = points[first + i];
        vec3 d = (p.xyz - origin) - centred_mean;
        float weight = PLAIN_WEIGHTS != 0 ? p.w : p.w * p.w;
        diagonal += weight * d * d;
        off += weight * d.xxy * d.yzz;
        total += weight;
    }
    diagonal = subgroupAdd(diagonal);
    off = subgroupAdd(off);
    total = subgroupAdd(total);

    // Depth and position, in the camera's frame.
    uint heavy = min(heaviest[item], n - 1);
    // guard: depth of a group without the heaviest
    float depth = labels[first + heavy] == prime ? points[first + heavy].z : origin.z + centred_mean.z;
    vec2 centre = vec2(at(CENTRE, item), at(CENTRE + 1, item));
    vec2 ray = (centre - vec2(view.cx, view.cy)) / vec2(view.fx, view.fy);
    vec3 position = vec3(ray * depth, depth);

    // Eigenvalues and axes of C, by Jacobi's rotations on C / trace.
    float trace = diagonal.x + diagonal.y + diagonal.z;
    vec3 axis_1 = vec3(1.0, 0.0, 0.0), axis_2 = vec3(0.0, 1.0, 0.0), axis_3 = vec3(0.0, 0.0, 1.0);
    vec3 value = vec3(0.0);
    if (trace > 0.0) {
        value = diagonal / trace;
        off /= trace;
        for (uint sweep = 0; sweep < SWEEPS; sweep += 1) {
            turn(value.x, value.y, off.x, off.y, off.z, axis_1, axis_2);
            turn(value.x, value.z, off.y, off.x, off.z, axis_1, axis_3);
            turn(value.y, value.z, off.z, off.x, off.y, axis_2, axis_3);
        }
        order(value.x, value.y, axis_1, axis_2);
        order(value.y, value.z, axis_2, axis_3);
        order(value.x, value.y, axis_1, axis_2);
        value *= trace / total;
    }
    value = max(value, vec3(EIGENVALUE_MIN * push.unit * push.unit)); // guard: floor of the eigenvalues
    // The third axis looks at the camera, which is at the origin of this frame; the second makes the frame right-handed.
    if (dot(axis_3, position) > 0.0) axis_3 = -axis_3;
    if (dot(cross(axis_1, axis_2), axis_3) < 0.0) axis_2 = -axis_2;

    // Calibration: the k^2 that brings k^2*Q closest to S in the Frobenius norm. Q = MM^T, M = J R diag(sqrt(lambda)), rows m1 and m2.
    vec2 slope = clamp(ray, view.slope_low, view.slope_high);
    vec3 deviation = sqrt(value);
    vec3 m1 = view.fx / depth * deviation * vec3(axis_1.x - slope.x * axis_1.z, axis_2.x - slope.x * axis_2.z, axis_3.x - slope.x * axis_3.z);
    vec3 m2 = view.fy / depth * deviation * vec3(axis_1.y - slope.y * axis_1.z, axis_2.y - slope.y * axis_2.z, axis_3.y - slope.y * axis_3.z);
    vec3 q = vec3(dot(m1, m1), dot(m1, m2), dot(m2, m2));
    vec3 s = screen_covariance(vec2(at(LOG_SCALE, item), at(LOG_SCALE + 1, item)), at(ANGLE, item));
    float size = q.x + q.z; // Q in units of its trace: its square then neither overflows nor vanishes
    vec3 unit_q = q / size;
    float k2 = (unit_q.x * s.x + 2.0 * unit_q.y * s.y + unit_q.z * s.z) /
               ((unit_q.x * unit_q.x + 2.0 * unit_q.y * unit_q.y + unit_q.z * unit_q.z) * size);

    Lift lift;
    lift.mean = view.eye + to_world(view, position);
    lift.log_scale = 0.5 * log(k2 * value);
    lift.quat = quaternion(to_world(view, axis_1), to_world(view, axis_2), to_world(view, axis_3));
    lift.dc = (vec3(at(COLOR, item), at(COLOR + 1, item), at(COLOR + 2, item)) - 0.5) / SH_C0;
    lift.opacity = at(LOGIT, item);
    vec3 toward = to_world(view, -position);
    lift.lobe_dir = normalize(toward);
    lift.theta_bar = nearest_view_angle(lift.mean, toward, source);
    lift.lobe_width = clamp(7.0 * lift.theta_bar / PI, 0.01, 1.0);
    lift.cluster_size = cluster_sizes[item];

    bool sound = k2 > 0.0 && is_finite(vec4(lift.mean, lift.opacity)) && is_finite(vec4(lift.log_scale, lift.theta_bar)) &&
                 is_finite(lift.quat) && is_finite(vec4(lift.dc, 0.0)) && is_finite(vec4(lift.lobe_dir, 0.0));
    // guard: lifts that are numbers (2 lines)
    if (sound) return lift;
    return NO_LIFT;
}

void main() {
    uint item = subgroup_index();
    if (item >= push.count) return;
    uint v = screen_frames[item];
    Lift lift = NO_LIFT;
    if (cluster_sizes[item] > 0 && v < push.view_count) lift = make_lift(item, views[v], v);
    if (subgroupElect()) {
        lifts[item] = lift;
        lift_flags[item] = lift.cluster_size > 0 ? 1 : 0;
    }
}

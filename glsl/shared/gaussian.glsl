// Projection of one Gaussian (EWA) and its lobe; shared by the forward and the backward pass.
#include "unit.glsl"
#include "trig.glsl"

float sigmoid(float x) { return 1.0 / (1.0 + exp(-x)); }

// Rotation of a unit quaternion (w, x, y, z); columns are the Gaussian's axes.
mat3 rotation(vec4 q) {
    float w = q.x, x = q.y, y = q.z, z = q.w;
    return mat3(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y),
                2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x),
                2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
}

struct Projection {
    vec3 p;          // camera space
    float inv_z;
    vec2 t;          // x/z and y/z as used by the Jacobian, clamped
    vec3 jw1, jw2;   // rows of J W
    mat3 axes;       // rotation of the Gaussian
    vec3 scale;
    vec3 m1, m2;     // rows of M = J W R S
    vec3 n;          // m1 x m2
    float a, b, c;   // M M^T
    float det0, det; // without and with dilation
};

// Sigma2D = M M^T + 0.3 I. The determinant is |m1 x m2|^2 + 0.3 (a + c) + 0.09, all terms positive. A
// needle's m1 and m2 are nearly parallel, yet m1 x m2 does not cancel: in the Gaussian's own axes each of its components is two
// scales' product times one of jw1 x jw2, whose rows are far from parallel.
Projection project_covariance(View view, vec3 p, vec4 unit_quat, vec3 scale) {
    Projection e;
    e.p = p;
    e.inv_z = 1.0 / p.z;
    e.t = clamp(p.xy * e.inv_z, view.slope_low, view.slope_high); // guard: clamp of the Jacobian
    e.jw1 = view.fx * e.inv_z * (view.row_x.xyz - e.t.x * view.row_z.xyz);
    e.jw2 = view.fy * e.inv_z * (view.row_y.xyz - e.t.y * view.row_z.xyz);
    e.axes = rotation(unit_quat);
    e.scale = scale;
    e.m1 = (e.jw1 * e.axes) * scale;
    e.m2 = (e.jw2 * e.axes) * scale;
    e.a = dot(e.m1, e.m1);
    e.b = dot(e.m1, e.m2);
    e.c = dot(e.m2, e.m2);
    e.n = cross(e.m1, e.m2);
    e.det0 = dot(e.n, e.n); // guard: determinant of needles
    e.det = e.det0 + DILATION * (e.a + e.c) + DILATION * DILATION;
    return e;
}

struct Lobe {
    float factor;       // of the opacity, 0 outside the support
    float log_cos;      // ln cos(psi/2)
    float exponent;     // exp(sharpness)
    float psi;          // theta / width
    float tangent;      // tan(psi/2)
    float tan_over_sin; // tan(psi/2) / sin(theta), its limit 1/(2 width) at theta = 0
    float cos_theta;
    vec3 axis, v;       // unit lobe direction; unit vector from the Gaussian to the eye
    float direction_length;
};

// Method, section 1: ((cos psi + 1)/2)^exp(beta) = cos(psi/2)^(2 exp(beta)), psi = theta/T, 0 from psi = pi on.
Lobe eval_lobe(vec3 direction, float width, float sharpness, vec3 v) {
    Lobe l;
    l.factor = 0.0;
    l.v = v;
    vec4 axis = vec4(direction, 0.0);
    l.direction_length = to_unit(axis);
    l.axis = axis.xyz;
    vec3 normal = cross(l.axis, v);
    l.cos_theta = dot(l.axis, v);
    float sin_theta = length(normal);
    float theta = angle_of(sin_theta, l.cos_theta); // guard: angle by its tangent
    l.psi = theta / width;
    // Without a direction the angle is that of (0, 0), which is unspecified. llvmpipe gives NaN there, so no
    // test on it can notice if the check of the length is missing.
    if (!(l.direction_length > 0.0 && l.psi < PI)) return l; // guard: support of a lobe
    float half_psi = 0.5 * l.psi;
    l.exponent = exp(sharpness);
    vec2 half_turn = cos_sin(half_psi);
    // Near 1 a driver's logarithm may be off by 2^-21, while the exponent is in the thousands: use the series
    // of ln cos there, exact to 1e-7.
    float x2 = half_psi * half_psi;
    float series = -x2 * (1.0 / 2.0 + x2 * (1.0 / 12.0 + x2 * (1.0 / 45.0 + x2 * (17.0 / 2520.0 + x2 * (31.0 / 14175.0 + x2 * (691.0 / 935550.0))))));
    l.log_cos = half_psi < 0.5 ? series : log(max(half_turn.x, 1e-30)); // guard: logarithm near 1
    l.tangent = half_turn.y / half_turn.x;
    l.factor = exp(2.0 * l.exponent * l.log_cos);
    // sin(theta) is also small at theta near pi. There a width of 1 still has a value, but not this limit.
    // guard: limit at θ = 0; no limit at θ = π
    l.tan_over_sin = sin_theta > 1e-4 || l.cos_theta < 0.0 ? l.tangent / sin_theta : 0.5 / width;
    return l;
}

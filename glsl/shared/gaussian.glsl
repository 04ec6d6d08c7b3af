// Projection of one Gaussian (EWA), its colour and its lobe; shared by the forward and the backward pass.
// Needs: the blocks Geometry and Sh, View, and `push.stride`.
#include "unit.glsl"

const uint MEAN = 0, LOG_SCALE = 3, QUAT = 6, OPACITY = 10; // planes of `geometry`
const uint LOBE_DIRECTION = 0, LOBE_WIDTH = 3, LOBE_SHARPNESS = 4; // planes of `lobes`
float plane(uint p, uint i) { return geometry[p * push.stride + i]; }
vec3 plane3(uint p, uint i) { return vec3(plane(p, i), plane(p + 1, i), plane(p + 2, i)); }
vec3 sh_at(uint k, uint i) {
    return vec3(sh[(3 * k) * push.stride + i], sh[(3 * k + 1) * push.stride + i], sh[(3 * k + 2) * push.stride + i]);
}

float sigmoid(float x) { return 1.0 / (1.0 + exp(-x)); }

// The length of a quaternion or lobe direction means nothing, but a step of fixed length turns a short one wildly and a long
// one not at all. Outside these bounds the vector is made a unit vector before it steps.
const float LENGTH_MIN = 0.01, LENGTH_MAX = 100.0;
bool wants_unit(float length_of) { return !(length_of >= LENGTH_MIN && length_of <= LENGTH_MAX); }

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
    vec2 t;          // x/z and y/z as the Jacobian takes them, clamped
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
    vec2 limit = vec2(view.limit_x, view.limit_y);
    e.t = clamp(p.xy * e.inv_z, -limit, limit);
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
    e.det0 = dot(e.n, e.n);
    e.det = e.det0 + DILATION * (e.a + e.c) + DILATION * DILATION;
    return e;
}

// Real spherical harmonics with 3DGS's signs; `d` is a unit vector. Basis functions up to `degree`.
void sh_basis(vec3 d, uint degree, out float basis[16]) {
    float x = d.x, y = d.y, z = d.z;
    basis[0] = SH_C0;
    if (degree < 1) return;
    basis[1] = -0.4886025119029199 * y;
    basis[2] = 0.4886025119029199 * z;
    basis[3] = -0.4886025119029199 * x;
    if (degree < 2) return;
    float xx = x * x, yy = y * y, zz = z * z;
    basis[4] = 1.0925484305920792 * x * y;
    basis[5] = -1.0925484305920792 * y * z;
    basis[6] = 0.31539156525252005 * (2.0 * zz - xx - yy);
    basis[7] = -1.0925484305920792 * x * z;
    basis[8] = 0.5462742152960396 * (xx - yy);
    if (degree < 3) return;
    basis[9] = -0.5900435899266435 * y * (3.0 * xx - yy);
    basis[10] = 2.890611442640554 * x * y * z;
    basis[11] = -0.4570457994644658 * y * (4.0 * zz - xx - yy);
    basis[12] = 0.3731763325901154 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
    basis[13] = -0.4570457994644658 * x * (4.0 * zz - xx - yy);
    basis[14] = 1.445305721320277 * z * (xx - yy);
    basis[15] = -0.5900435899266435 * x * (xx - 3.0 * yy);
}

// Gradient of basis function k as a polynomial in (x, y, z).
vec3 sh_basis_gradient(vec3 d, uint k) {
    float x = d.x, y = d.y, z = d.z;
    switch (k) {
        case 1: return vec3(0.0, -0.4886025119029199, 0.0);
        case 2: return vec3(0.0, 0.0, 0.4886025119029199);
        case 3: return vec3(-0.4886025119029199, 0.0, 0.0);
        case 4: return 1.0925484305920792 * vec3(y, x, 0.0);
        case 5: return -1.0925484305920792 * vec3(0.0, z, y);
        case 6: return 0.31539156525252005 * vec3(-2.0 * x, -2.0 * y, 4.0 * z);
        case 7: return -1.0925484305920792 * vec3(z, 0.0, x);
        case 8: return 0.5462742152960396 * vec3(2.0 * x, -2.0 * y, 0.0);
        case 9: return -0.5900435899266435 * vec3(6.0 * x * y, 3.0 * (x * x - y * y), 0.0);
        case 10: return 2.890611442640554 * vec3(y * z, x * z, x * y);
        case 11: return -0.4570457994644658 * vec3(-2.0 * x * y, 4.0 * z * z - x * x - 3.0 * y * y, 8.0 * y * z);
        case 12: return 0.3731763325901154 * vec3(-6.0 * x * z, -6.0 * y * z, 6.0 * z * z - 3.0 * (x * x + y * y));
        case 13: return -0.4570457994644658 * vec3(4.0 * z * z - 3.0 * x * x - y * y, -2.0 * x * y, 8.0 * x * z);
        case 14: return 1.445305721320277 * vec3(2.0 * x * z, -2.0 * y * z, x * x - y * y);
        case 15: return -0.5900435899266435 * vec3(3.0 * (x * x - y * y), -6.0 * x * y, 0.0);
    }
    return vec3(0.0);
}

struct Lobe {
    float factor;       // of the opacity, 0 outside the support
    float log_cos;      // ln cos(psi/2)
    float exponent;     // exp(sharpness)
    float psi;          // theta / width
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
    float theta = atan(sin_theta, l.cos_theta);
    l.psi = theta / width;
    if (!(l.direction_length > 0.0 && l.psi < PI)) return l;
    float half_psi = 0.5 * l.psi;
    l.exponent = exp(sharpness);
    // Near 0 the logarithm of the cosine is -x^2/2 - x^4/12: exact to 1e-9 below 0.03, where log(cos) keeps no digits.
    float x2 = half_psi * half_psi;
    l.log_cos = half_psi < 0.03 ? -x2 * (0.5 + x2 / 12.0) : log(max(cos(half_psi), 1e-30));
    l.factor = exp(2.0 * l.exponent * l.log_cos);
    // sin(theta) is small at theta near pi too, where a width of 1 still has a value and no such limit.
    l.tan_over_sin = sin_theta > 1e-4 || l.cos_theta < 0.0 ? tan(half_psi) / sin_theta : 0.5 / width;
    return l;
}

// Color by spherical betas (Liu et al. 2025, "Deformable Beta Splatting", and the release's parameters).
// Besides a constant, like that of harmonics, a Gaussian has lobes of light, each pointing to where its
// cosine is 1,
//     sum over lobes of softplus(color) max(0, mu . v)^(4 exp(b)),   mu = (sin theta cos phi, sin theta sin phi, cos theta),
// v from the eye to the Gaussian and softplus(x) = log2(1 + 2^(10 x)) / 10. A lobe only adds light; with
// color 0 it adds a tenth.
//
// Coefficient 0 of a Gaussian is the constant, 1 + 2m the color of lobe m, and 2 + 2m its theta, phi and b.
// The including kernel also includes unit.glsl.
#include "trig.glsl"

const uint BETAS = 4;      // value of SH_DEGREE that selects betas
const uint BETA_LOBES = 2; // lobes of a Gaussian
const uint BETA_GROUPS = (1 + 2 * BETA_LOBES + 3) / 4; // of four coefficients, read together
// The exponent goes from 1, below which the slope at the edge has no bound, to 4386, a lobe of one degree at
// half its light. At 4386 the cosine's rounding is a thousandth of the value.
const float BETA_MIN = -1.3862944;
const float BETA_MAX = 7.0;
bool is_beta_b(uint plane) { return plane > 3 && plane % 6 == 2; } // `plane` of `sh`

struct Beta {
    vec3 light, slope; // softplus of the color and its derivative
    vec3 axis;
    float factor;      // max(0, mu . v)^(4 exp(b))
    float by_cosine;   // derivatives of `factor`: by mu . v,
    vec3 by_shape;     // by theta, phi and b
};

// Reduces an angle from a file to one turn.
float within_turn(float angle) { return clamp(angle - 2.0 * PI * round(angle / (2.0 * PI)), -PI, PI); }

Beta beta_at(vec3 v, vec3 color, vec3 shape) {
    Beta l;
    l.light = max(color, vec3(0.0)) + 0.1 * log2(1.0 + exp2(-10.0 * abs(color)));
    l.slope = 1.0 / (1.0 + exp2(-10.0 * color));
    float theta = within_turn(shape.x), phi = within_turn(shape.y);
    vec2 of_theta = cos_sin(theta), of_phi = cos_sin(phi);
    float sin_theta = of_theta.y, cos_theta = of_theta.x, sin_phi = of_phi.y, cos_phi = of_phi.x;
    // The exponent is in the thousands: a rounding error in the axis's length would show.
    l.axis = normalize(vec3(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta));
    l.factor = l.by_cosine = 0.0;
    l.by_shape = vec3(0.0);
    float cosine = min(dot(l.axis, v), 1.0);
    if (!(cosine >= FLOAT_MIN)) return l; // guard: behind a beta
    float exponent = 4.0 * exp(clamp(shape.z, BETA_MIN, BETA_MAX)); // guard: b of a file
    float log_factor = exponent * log(cosine);
    l.factor = exp(log_factor);
    l.by_cosine = exponent * l.factor / cosine;
    l.by_shape = vec3(l.by_cosine * dot(vec3(cos_theta * cos_phi, cos_theta * sin_phi, -sin_theta), v),
                      l.by_cosine * sin_theta * (cos_phi * v.y - sin_phi * v.x), log_factor * l.factor);
    return l;
}

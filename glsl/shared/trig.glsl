#ifndef TRIG
#define TRIG
// Own sines, cosines and angles. Vulkan grants a driver's sine and cosine an error of 2^-11, and that only
// within [-pi, pi], and its arc tangent 4096 units in the last place. With a lobe's exponent of up to 2981
// that would be an error of 1e-2 in its gradients.
//
// Polynomials of Cephes (Moshier 1989) on reduced ranges, in plain multiplications and additions. Relative
// errors, measured in float32: sine and cosine 1e-7, cosine near pi/2 1.2e-7, angles 2.3e-7.

// Cosine and sine of |x| <= 2^13, reduced by the nearest multiple of pi/2, which is subtracted in three parts
// that float32 holds exactly.
// `precise`, so that two kernels that decide by it (lift_count, lift_points) get the same bits.
vec2 cos_sin(float x) {
    precise float turns = round(x * 0.63661977);
    precise float r = ((x - turns * 1.5703125) - turns * 4.8375129699707031e-4) - turns * 7.549790126404332e-8;
    precise float z = r * r;
    precise float s = r + r * z * (-1.6666654611e-1 + z * (8.3321608736e-3 - z * 1.9515295891e-4));
    precise float c = 1.0 - 0.5 * z + z * z * (4.166664568298827e-2 + z * (-1.388731625493765e-3 + z * 2.443315711809948e-5));
    int quarter = int(turns) & 3;
    vec2 turned = (quarter & 1) == 0 ? vec2(c, s) : vec2(s, c);
    return vec2(quarter == 1 || quarter == 2 ? -turned.x : turned.x, quarter >= 2 ? -turned.y : turned.y);
}

// Angle from 0 to pi of a vector (x, y), y >= 0, of any length. Unspecified, maybe NaN, for (0, 0).
float angle_of(float y, float x) {
    float a = min(abs(x), y) / max(abs(x), y);
    bool steep = a > 0.41421356;
    float t = steep ? (a - 1.0) / (a + 1.0) : a;
    float z = t * t;
    float angle = t + t * z * (-3.33329491539e-1 + z * (1.99777106478e-1 + z * (-1.38776856032e-1 + z * 8.05374449538e-2)));
    if (steep) angle += 0.25 * PI;
    if (y > abs(x)) angle = 0.5 * PI - angle;
    return x < 0.0 ? PI - angle : angle;
}
#endif

// Random numbers from a counter: pcg4d (Jarzynski and Olano, "Hash functions for GPU rendering", 2020) hashes
// four words; the other functions turn a word into a uniform, exponential or normal number.
#include "trig.glsl"

uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    for (uint k = 0; k < 2; ++k) {
        v.x += v.y * v.w;
        v.y += v.z * v.x;
        v.z += v.x * v.y;
        v.w += v.y * v.z;
        if (k == 0) v ^= v >> 16;
    }
    return v;
}

// Above 0 and below 1: float32 represents the upper 23 bits plus a half exactly.
float uniform_of(uint h) { return (float(h >> 9) + 0.5) / 8388608.0; }

// -ln(1 - u). For small u, where 1 - u has few digits in float32, a series, exact to u^6 / 7 < 1e-8.
float exponential_of(uint h) {
    float u = uniform_of(h);
    float series = u * (1.0 + u * (1.0 / 2.0 + u * (1.0 / 3.0 + u * (1.0 / 4.0 + u * (1.0 / 5.0 + u / 6.0)))));
    return u < 0.0625 ? series : -log(1.0 - u);
}

// Three normal deviates (Box and Muller 1958).
vec3 normal_of(uvec4 h) {
    float a = sqrt(-2.0 * log(uniform_of(h.x))), b = sqrt(-2.0 * log(uniform_of(h.z)));
    float p = 2.0 * PI * uniform_of(h.y), q = 2.0 * PI * uniform_of(h.w);
    return vec3(a * cos_sin(p), b * cos_sin(q).x);
}

// Moments of a number, Adam's or the first and the curvature, and both in one word.
struct Moments { float first, second; };

// The second moment in 18 bits: what float32 has of a positive number less 13 bits, which leaves 2^-10 of it. The
// first in 14 bits, by how many square roots of the second it is, in steps of 1/1024 up to 8: Adam's is 7.3 at most (see adam_one.glsl),
// and what more a gradient is than the root of its curvature, of which it is a part where the curvature is known well, is cut off.
// A second moment moves by a thousandth of itself in a step, so what is cut off decides by a draw whether it is rounded up: on
// average nothing is lost. `dither`: 23 random bits, the highest first.
const uint SECOND_CUT = 13, FIRST_BITS = 14;
const float FIRST_STEPS = 1024.0, FIRST_MAX = 8191.0;

uint pack_moments(Moments m, uint dither) {
    uint second = (floatBitsToUint(m.second) + (dither >> (32 - SECOND_CUT))) >> SECOND_CUT; // guard: rounded by a draw
    float root = sqrt(uintBitsToFloat(second << SECOND_CUT));
    float steps = root > 0.0 ? FIRST_STEPS * m.first / root : 0.0;
    float drawn = float(dither >> 9 & 0x3FFu) / 1024.0;
    steps = clamp(floor(steps + drawn), -FIRST_MAX, FIRST_MAX); // guard: gradients beyond the root of their curvature
    return second << FIRST_BITS | uint(int(steps)) & 0x3FFFu;
}

Moments unpack_moments(uint word) {
    float second = uintBitsToFloat(word >> FIRST_BITS << SECOND_CUT);
    int first = int(word << (32 - FIRST_BITS)) >> (32 - FIRST_BITS);
    return Moments(float(first) / FIRST_STEPS * sqrt(second), second);
}

// Bits by Gaussian, plane and step (a mix of Wellons, "Prospecting for hash functions", 2018).
uint dither_of(uint number, uint plane, uint step) {
    uint x = number + plane * 0x9E3779B9u + step * 0x85EBCA6Bu;
    x = (x ^ x >> 16) * 0x7FEB352Du;
    x = (x ^ x >> 15) * 0x846CA68Bu;
    return x ^ x >> 16;
}

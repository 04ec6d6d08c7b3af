// The two moments of a number (Adam's, or the first moment and the curvature), and their packing into one
// word.
struct Moments { float first, second; };

// Each takes 16 bits, a float32 without its lower bits. The second moment, which has no sign, is exact to
// 2^-8 and the first to 2^-7.
// A second moment moves by a thousandth of itself in a step, so a random draw decides whether it is rounded
// up or down: on average nothing is lost. `dither`: 32 random bits.
uint pack_moments(Moments m, uint dither) {
    uint second = (floatBitsToUint(m.second) + (dither & 0x7FFFu)) >> 15; // guard: rounded by a draw
    return second << 16 | (floatBitsToUint(m.first) + (dither >> 16)) >> 16;
}

Moments unpack_moments(uint word) { return Moments(uintBitsToFloat(word << 16), uintBitsToFloat(word >> 16 << 15)); }

// Packs the first moments of three channels into 10 bits each, as multiples of `roots`, the root of the
// curvature. A sign, 5 bits of an exponent from 2^-28 to 8 and 4 bits of mantissa, rounded by a draw too.
// Smaller numbers become 0.
const uint BAND_CUT = 19, BAND_LEAST = 99u << 4;

uint pack_firsts(vec3 first, vec3 roots, uint dither) {
    uint word = 0;
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        float by = roots[c] > 0.0 ? first[c] / roots[c] : 0.0;
        uint size = (floatBitsToUint(abs(by)) + ((dither >> (10 * c) & 0x3FFu) << (BAND_CUT - 10))) >> BAND_CUT;
        size = clamp(size, BAND_LEAST, BAND_LEAST + 0x1FFu) - BAND_LEAST; // guard: gradients beyond the root of their curvature
        word |= (size | (by < 0.0 ? 0x200u : 0u)) << (10 * c);
    }
    return word;
}

vec3 unpack_firsts(uint word, vec3 roots) {
    vec3 first;
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        uint code = word >> (10 * c), size = code & 0x1FFu;
        float by = size > 0 ? uintBitsToFloat((size + BAND_LEAST) << BAND_CUT) : 0.0;
        first[c] = roots[c] * ((code & 0x200u) != 0 ? -by : by);
    }
    return first;
}

// Random bits by Gaussian, plane and step (a mix of Wellons, "Prospecting for hash functions", 2018).
uint dither_of(uint number, uint plane, uint step) {
    uint x = number + plane * 0x9E3779B9u + step * 0x85EBCA6Bu;
    x = (x ^ x >> 16) * 0x7FEB352Du;
    x = (x ^ x >> 15) * 0x846CA68Bu;
    return x ^ x >> 16;
}

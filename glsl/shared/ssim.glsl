// Tiles and window of the L1 + SSIM loss, shared by its kernels.
// Wang et al., "Image Quality Assessment: From Error Visibility to Structural Similarity", 2004; loss as in Kerbl et al.,
// "3D Gaussian Splatting", 2023: (1 - SSIM_WEIGHT) * mean |x - y| + SSIM_WEIGHT * (1 - mean SSIM), means over pixels and
// channels. Outside the image both pictures are 0 and the window's weights are not renormalised (conv2d, padding 5).

#include "frame.glsl"

// This workgroup size fits 3 channels * (TILE + 2 * RADIUS) columns; the kernels rely on it.
const uint WORKGROUP = 128;
// Side of a tile, px. A workgroup takes one tile.
const uint TILE = 32;
const int RADIUS = 5;
// (0.01 * 1)^2 and (0.03 * 1)^2; the range of a channel is 1.
const float C1 = 0.01 * 0.01;
const float C2 = 0.03 * 0.03;
// Moments are those of x - MIDDLE and y - MIDDLE, -MIDDLE outside the image. Covariances stay the same, since
// with the padding the weights add up to 1. Their float32 error is a quarter of that with x and y.
const float MIDDLE = 0.5;

// The window: exp(-d^2 / (2 * 1.5^2)) for d = 0..5, divided by the sum over -5..5.
const float E1 = exp(-1.0 / 4.5);
const float E2 = exp(-4.0 / 4.5);
const float E3 = exp(-9.0 / 4.5);
const float E4 = exp(-16.0 / 4.5);
const float E5 = exp(-25.0 / 4.5);
const float W0 = 1.0 / (1.0 + 2.0 * (E1 + E2 + E3 + E4 + E5));
const float W1 = E1 * W0;
const float W2 = E2 * W0;
const float W3 = E3 * W0;
const float W4 = E4 * W0;
const float W5 = E5 * W0;

// Ten unfinished sums of the filter in transposed form. Each sample is added to all windows that contain it
// as it comes by, so it is read once and nothing is shifted. s0 lacks one sample, s9 ten.
#define FILTER(T, NAME) \
    struct NAME { T s0, s1, s2, s3, s4, s5, s6, s7, s8, s9; }; \
    /* Takes the next sample; the answer is centred on the sample of RADIUS steps before. */ \
    T feed(inout NAME f, T v) { \
        T done = f.s0 + W5 * v; \
        f.s0 = f.s1 + W4 * v; \
        f.s1 = f.s2 + W3 * v; \
        f.s2 = f.s3 + W2 * v; \
        f.s3 = f.s4 + W1 * v; \
        f.s4 = f.s5 + W0 * v; \
        f.s5 = f.s6 + W1 * v; \
        f.s6 = f.s7 + W2 * v; \
        f.s7 = f.s8 + W3 * v; \
        f.s8 = f.s9 + W4 * v; \
        f.s9 = W5 * v; \
        return done; \
    }
FILTER(vec3, Filter3)
FILTER(vec4, Filter4)
const Filter3 EMPTY3 = Filter3(vec3(0), vec3(0), vec3(0), vec3(0), vec3(0), vec3(0), vec3(0), vec3(0), vec3(0), vec3(0));
const Filter4 EMPTY4 = Filter4(vec4(0), vec4(0), vec4(0), vec4(0), vec4(0), vec4(0), vec4(0), vec4(0), vec4(0), vec4(0));

uint tiles_across(Frame frame) {
    return (frame.width + TILE - 1) / TILE;
}

uint tiles_of(Frame frame) {
    return tiles_across(frame) * ((frame.height + TILE - 1) / TILE);
}

bool within(Frame frame, ivec2 at) {
    return uint(at.x) < frame.width && uint(at.y) < frame.height; // guard: loss beyond the image's edge
}

// Channel of a packed RGBA8 pixel, in [0, 1].
float target_channel(uint packed, uint channel) {
    return float(packed >> 8 * channel & 0xFFu) / 255.0;
}

// False if a mask leaves out a packed pixel: its alpha is 0. The loss there is that of a render equal to the
// photograph, without a gradient.
bool counts(uint packed) {
    return packed >> 24 != 0;
}

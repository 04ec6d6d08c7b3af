#version 460
// Composites a photograph over a background. Training draws one for some steps, so that black Gaussians in front of a transparent photograph's
// black background cost error.
//
// One thread takes one pixel. photographs (RGB over the data set's background; A: 0 if the pixel does not count, else opacity, from 1 for
// transparent to 255) -> targets (RGB over the step's background; A: 0 or 255)
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/ssim.glsl"

layout(push_constant, scalar) uniform Push {
    uint first;  // first pixel in photographs
    uint pixels;
    ivec3 change; // the step's background less the data set's, in steps of 1/255
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Photographs { uint photographs[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Targets { uint targets[]; };

void main() {
    uint pixel = thread_index();
    if (!(pixel < push.pixels)) return;
    uint packed = photographs[push.first + pixel];
    int transparency = 255 - int(packed >> 24); // of 254
    uint composited = counts(packed) ? 255u << 24 : 0u;
    for (uint c = 0; c < 3; ++c) {
        int more = transparency * push.change[c];
        int value = int(packed >> 8 * c & 0xFFu) + sign(more) * ((abs(more) + 127) / 254); // rounded
        composited |= uint(clamp(value, 0, 255)) << 8 * c;
    }
    targets[pixel] = composited;
}

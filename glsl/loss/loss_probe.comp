#version 460
// Draws a random gradient of the image instead of deriving one. The backward pass's result, squared and
// averaged, is then the diagonal of the loss's curvature by the parameters.
//
// One thread takes one pixel of a frame. frames, image, targets -> image_grad, 3 per pixel
// Method, section 5. The L1 part of the loss is approximated by the parabola that touches it at the render
// (iteratively reweighted least squares), whose curvature by a channel is w = (1 - SSIM_WEIGHT) / (3 pixels
// max(|x - y|, LEAST_DIFFERENCE)). With s = 1 or -1 at random the mean of (J^T s sqrt(w))^2 is the diagonal
// of J^T W J (Hutchinson 1990). 0 if a pixel does not count.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/ssim.glsl"
#include "../shared/hash.glsl"

layout(constant_id = 1) const float SSIM_WEIGHT = 0.2;

const float LEAST_DIFFERENCE = 0.01;
const uint HASH_PROBE = 5; // different from those of density.glsl

layout(push_constant, scalar) uniform Push {
    uint frame; // index in frames
    uint step;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Targets { uint targets[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer ImageGrad { float image_grad[]; };

void main() {
    Frame frame = frames[push.frame];
    uint pixel = thread_index(), pixels = frame.width * frame.height;
    if (!(pixel < pixels)) return;
    uint at = frame.image_first + pixel, target = targets[frame.target_first + pixel];
    uvec4 h = pcg4d(uvec4(pixel, push.frame, push.step, HASH_PROBE));
    for (uint channel = 0; channel < 3; ++channel) {
        float difference = abs(image[at][channel] - target_channel(target, channel));
        float root = sqrt((1.0 - SSIM_WEIGHT) / (3.0 * float(pixels) * max(difference, LEAST_DIFFERENCE)));
        // guard: masks: probes
        image_grad[3 * at + channel] = counts(target) ? (h[channel] >> 31 != 0 ? -root : root) : 0.0;
    }
}

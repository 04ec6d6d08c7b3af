#version 460
// Writes per-pixel terms of the Gaussians' scores, or of the colors that a view asks of them, in place of an
// image's gradient: blend_backward then sums them by blend weight.
//
// One thread takes one pixel of a frame. frames, image, targets -> image_grad: two numbers by TERMS, and 0; all
// 0 if the pixel does not count or its error is not finite.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/unit.glsl"
#include "../shared/ssim.glsl"
#include "../shared/density.glsl"

layout(constant_id = 1) const uint TERMS = ERRORS;

layout(push_constant, scalar) uniform Push {
    uint frame; // index in frames
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Targets { uint targets[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer ImageGrad { float image_grad[]; };

void main() {
    Frame frame = frames[push.frame];
    uint pixel = thread_index();
    if (!(pixel < frame.width * frame.height)) return;
    uint target = targets[frame.target_first + pixel];
    vec3 shown = image[frame.image_first + pixel].rgb, wanted;
    for (uint c = 0; c < 3; ++c) wanted[c] = target_channel(target, c);
    vec3 off = shown - wanted;
    float error = (abs(off.x) + abs(off.y) + abs(off.z)) / 3.0;
    bool fine = counts(target) && error <= FLOAT_MAX; // guard: density: pixels that count; density: errors that are finite
    uint at = 3 * (frame.image_first + pixel);
    vec2 terms = TERMS == RED_GREEN ? off.xy : vec2(TERMS == BLUE ? off.z : error, 1.0);
    image_grad[at] = fine ? terms.x : 0.0;
    image_grad[at + 1] = fine ? terms.y : 0.0;
    image_grad[at + 2] = 0.0;
}

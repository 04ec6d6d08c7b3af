#version 460
// Writes the difference of an image from its photograph in place of an image's gradient: blend_backward then
// sums it for each Gaussian by blend weight. A sum has two numbers, so that an image takes two passes.
//
// One thread takes one pixel of a frame. frames, image, targets -> image_grad: differences of red and green,
// and 0; with SECOND that of blue, 1 and 0. All 0 if the pixel does not count or a difference is not finite.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/unit.glsl"
#include "../shared/ssim.glsl"

layout(constant_id = 1) const bool SECOND = false;

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
    vec3 off = image[frame.image_first + pixel].rgb;
    for (uint c = 0; c < 3; ++c) off[c] -= target_channel(target, c);
    vec3 size = abs(off);
    bool fine = counts(target) && size.x + size.y + size.z <= FLOAT_MAX; // guard: bands: pixels that count
    vec2 parts = SECOND ? vec2(off.z, 1.0) : off.xy;
    uint at = 3 * (frame.image_first + pixel);
    image_grad[at] = fine ? parts.x : 0.0;
    image_grad[at + 1] = fine ? parts.y : 0.0;
    image_grad[at + 2] = 0.0;
}

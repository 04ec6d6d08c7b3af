#version 460
// Applies a photograph's exposure map to the blended image: c' = M c + b.
//
// One thread takes one pixel of a frame. frames, maps, image -> corrected. Transmittance is copied. Colors
// are not clamped.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/exposure.glsl"

layout(push_constant, scalar) uniform Push {
    uint frame; // index in frames
    uint photo; // index of the map
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Maps { float maps[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer Corrected { vec4 corrected[]; };

void main() {
    Frame frame = frames[push.frame];
    uint pixel = thread_index();
    if (!(pixel < frame.width * frame.height)) return;
    vec4 shown = image[frame.image_first + pixel];
    vec3 mapped;
    for (uint row = 0; row < 3; ++row) {
        uint at = MAP * push.photo + 4 * row;
        mapped[row] = maps[at] * shown.r + maps[at + 1] * shown.g + maps[at + 2] * shown.b + maps[at + 3];
    }
    corrected[frame.image_first + pixel] = vec4(mapped, shown.a);
}

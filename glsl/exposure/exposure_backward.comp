#version 460
// Turns the gradient of a corrected image into those of the blended image and of the photograph's map.
//
// One subgroup takes SUM_PIXELS consecutive pixels of a frame. frames, maps, image, image_grad -> image_grad, sums
// With g the gradient by c' = M c + b, image_grad becomes transpose(M) g. sums gets the sum of g (c, 1)^T
// over the subgroup's pixels: MAP numbers for each subgroup, in the order of a map, added up in a fixed
// order. A pixel that does not count has g = 0 and adds nothing.
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
layout(set = 0, binding = 3, scalar) buffer ImageGrad { float image_grad[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer Sums { float sums[]; };

void main() {
    uint index = subgroup_index();
    Frame frame = frames[push.frame];
    uint pixels = frame.width * frame.height, first = index * SUM_PIXELS;
    if (!(first < pixels)) return;
    vec3 rows[3];
    for (uint row = 0; row < 3; ++row) {
        uint at = MAP * push.photo + 4 * row;
        rows[row] = vec3(maps[at], maps[at + 1], maps[at + 2]);
    }
    vec4 part[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    for (uint k = gl_SubgroupInvocationID; k < SUM_PIXELS; k += gl_SubgroupSize) {
        uint pixel = first + k;
        if (pixel < pixels) {
            uint at = frame.image_first + pixel;
            vec3 shown = image[at].rgb, g = vec3(image_grad[3 * at], image_grad[3 * at + 1], image_grad[3 * at + 2]);
            vec3 to_image = vec3(0.0);
            [[unroll]] for (uint row = 0; row < 3; ++row) {
                // If g is 0 the rendered color may be any value, even NaN.
                if (g[row] != 0.0) part[row] += g[row] * vec4(shown, 1.0); // guard: exposure: pixels that count
                to_image += g[row] * rows[row];
            }
            for (uint c = 0; c < 3; ++c) image_grad[3 * at + c] = to_image[c];
        }
    }
    [[unroll]] for (uint row = 0; row < 3; ++row) {
        [[unroll]] for (uint column = 0; column < 4; ++column) {
            float sum = subgroupAdd(part[row][column]);
            if (subgroupElect()) sums[MAP * index + 4 * row + column] = sum;
        }
    }
}

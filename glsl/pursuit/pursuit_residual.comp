#version 460
// Compares a view's render with its photograph: writes the unblurred texels of the pyramid and the errors by
// which pixels are drawn.
//
// One subgroup takes a block of ERROR_BLOCK pixels. image, targets, depths -> texels (unblurred), errors,
// error_sums and squares by block, explained (set to 0, see pursuit_attenuate)
// The error of a pixel is the square of its mean absolute difference. It is 0 if the pixel does not count
// (alpha 0 in `targets`), has no depth, or is not finite. `squares` has the squared error over channels of
// all pixels that count, with a depth or without. Renders are clamped to 0..1.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"
#include "../shared/frame.glsl"

layout(push_constant, scalar) uniform Push { uint view; } push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Plots { Plot plots[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Targets { uint targets[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Depths { float depths[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer Texels { Texel texels[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer SurfaceDepths { float surface_depths[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer Errors { float errors[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer ErrorSums { float error_sums[]; };
layout(set = 0, binding = 9, scalar) writeonly buffer Explained { uint explained[]; };
layout(set = 0, binding = 10, scalar) writeonly buffer Squares { float squares[]; };

void main() {
    Frame frame = frames[push.view];
    Plot plot = plots[push.view];
    uint block = subgroup_index(), pixels = frame.width * frame.height;
    if (block * ERROR_BLOCK >= pixels) return;
    float sum = 0.0, square = 0.0;
    for (uint k = gl_SubgroupInvocationID; k < ERROR_BLOCK; k += gl_SubgroupSize) {
        uint pixel = block * ERROR_BLOCK + k;
        if (pixel >= pixels) continue;
        vec3 render = image[frame.image_first + pixel].rgb;
        bool finite = all(lessThanEqual(abs(render), vec3(FLOAT_MAX)));
        render = finite ? clamp(render, vec3(0.0), vec3(1.0)) : vec3(0.0);
        vec4 photo = unpackUnorm4x8(targets[frame.target_first + pixel]);
        bool counts = photo.a > 0.0 && finite; // guard: pursuit: pixels that count
        vec3 difference = counts ? photo.rgb - render : vec3(0.0);
        float depth = depths[pixel];
        bool seen = depth > NEAR && depth <= FLOAT_MAX;
        float mean = dot(abs(difference), vec3(1.0 / 3.0)), error = seen ? mean * mean : 0.0;
        texels[pixel] = pack_texel(Beneath(difference, render, 0.0, 0.0));
        surface_depths[plot.pixel_first + pixel] = seen ? depth : 0.0;
        errors[plot.pixel_first + pixel] = error;
        explained[plot.pixel_first + pixel] = 0;
        sum += error;
        square += dot(difference, difference);
    }
    sum = subgroupAdd(sum);
    square = subgroupAdd(square);
    if (!subgroupElect()) return;
    error_sums[plot.block_first + block] = sum;
    squares[plot.block_first + block] = square;
}

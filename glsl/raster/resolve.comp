#version 460
// Converts a rendered view to the texels of a caller's image.
//
// One thread takes one pixel.
// image, depths, target (the caller's image, read for OVER) -> target, depth_target
// Depths are in a depth buffer's range, 0 to 1; pixels without a Gaussian get the clear value, the far
// plane's depth.
// Gaussians are trained and blended in sRGB-encoded values (Kerbl 2023). So OVER also blends in encoded
// values, and a linear target is converted afterwards. Exposure applies to the Gaussians only, not to what
// lies behind them. sRGB: IEC 61966-2-1, its curve extended above 1.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/resolve.glsl"

layout(constant_id = 1) const bool CURVES = true; // sRGB curves, needed for linear light and exposures; most of the time goes into them

layout(push_constant, scalar) uniform Push {
    uint pixels;
    uint format;     // RGBA8, ...
    uint blend;      // OPAQUE, ...
    uint linear;     // with CURVES, 1: the target holds linear light; 0: sRGB-encoded values
    uint depth;      // 1: depth_target is wanted
    float exposure;  // factor of the Gaussians' linear light; 1 without CURVES
    vec2 depth_form; // camera z becomes depth x + y / z
    vec3 background; // rgb, for OPAQUE; if exposure is 1 the image already includes it
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Depths { float depths[]; };
layout(set = 0, binding = 2, scalar) buffer Target { uint target[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer DepthTarget { float depth_target[]; };

vec3 to_linear(vec3 c) {
    return mix(pow((c + 0.055) / 1.055, vec3(2.4)), c / 12.92, lessThanEqual(c, vec3(0.04045)));
}
vec3 to_encoded(vec3 c) {
    return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, c * 12.92, lessThanEqual(c, vec3(0.0031308)));
}

vec4 load(uint pixel) {
    switch (push.format) {
        case RGBA8: return unpackUnorm4x8(target[pixel]);
        case BGRA8: return unpackUnorm4x8(target[pixel]).bgra;
        case RGBA16F: return vec4(unpackHalf2x16(target[2 * pixel]), unpackHalf2x16(target[2 * pixel + 1]));
    }
    uint at = 4 * pixel;
    return uintBitsToFloat(uvec4(target[at], target[at + 1], target[at + 2], target[at + 3]));
}

void store(uint pixel, vec4 c) {
    if (push.format == RGBA8) target[pixel] = packUnorm4x8(c);
    if (push.format == BGRA8) target[pixel] = packUnorm4x8(c.bgra);
    if (push.format == RGBA16F) {
        c = min(c, HALF_MAX);
        target[2 * pixel] = packHalf2x16(c.rg);
        target[2 * pixel + 1] = packHalf2x16(c.ba);
    }
    if (push.format == RGBA32F) {
        uvec4 words = floatBitsToUint(c);
        for (uint k = 0; k < 4; ++k) target[4 * pixel + k] = words[k];
    }
}

void main() {
    uint pixel = thread_index();
    if (pixel >= push.pixels) return;
    if (push.depth != 0) {
        float z = depths[pixel], empty = push.depth_form.y < 0.0 ? 1.0 : 0.0;
        // guard: depths that a buffer can hold
        depth_target[pixel] = z > 0.0 ? clamp(push.depth_form.x + push.depth_form.y / z, 0.0, 1.0) : empty;
    }
    vec4 rendered = image[pixel]; // rgb, and transmittance
    bool whole = push.blend == OPAQUE && push.exposure == 1.0; // the image is over its background, else over black
    float T = rendered.a, alpha = whole ? 1.0 : 1.0 - T;
    // The color before multiplication by alpha.
    vec3 straight = alpha > 0.0 ? rendered.rgb / alpha : vec3(0.0);
    if (CURVES && push.exposure != 1.0) straight = to_encoded(push.exposure * to_linear(straight));
    bool linear = CURVES && push.linear != 0;
    vec4 result;
    if (whole || push.blend == PREMULTIPLIED) {
        result = vec4(alpha * (linear ? to_linear(straight) : straight), alpha);
    } else {
        vec4 below = vec4(push.background, 1.0);
        if (push.blend == OVER) {
            below = load(pixel);
            if (linear) below.rgb = to_encoded(max(below.rgb, vec3(0.0)));
        }
        vec3 both = alpha * straight + T * below.rgb;
        result = vec4(linear ? to_linear(both) : both, push.blend == OVER ? alpha + T * below.a : 1.0);
    }
    store(pixel, result);
}

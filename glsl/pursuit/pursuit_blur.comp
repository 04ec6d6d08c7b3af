#version 460
// Computes a level of a view's pyramid: from its unblurred texels, or from the level below, at half its
// resolution.
//
// One thread computes one texel: means, covariance and variance of all pixels under its weights. from_texels
// -> texels. Weights outside the image are left out. Five texels across suffice for the first level's
// deviation of 0.7, eight for the next ones' 1.2124: both cover at least 2.8 deviations, and 0.5 % of the
// weight lies beyond.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/pursuit.glsl"

layout(constant_id = 1) const bool HALVE = false; // from the level below

layout(push_constant, scalar) uniform Push {
    uint from_first, from_width, from_height;
    uint first, width, height;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer FromTexels { Texel from_texels[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer Texels { Texel texels[]; };

void main() {
    uint i = thread_index();
    if (i >= push.width * push.height) return;
    ivec2 at = ivec2(i % push.width, i / push.width);
    // The texel's centre in source texels, and its first source texel.
    vec2 middle = HALVE ? vec2(2 * at + 1) : vec2(at) + 0.5;
    ivec2 begin = HALVE ? 2 * at - 3 : at - 2;
    int across = HALVE ? 8 : 5;
    float deviation = HALVE ? NEXT_BLUR : FIRST_BLUR;
    Beneath sum = Beneath(vec3(0.0), vec3(0.0), 0.0, 0.0);
    float total = 0.0;
    for (int y = max(begin.y, 0); y < min(begin.y + across, int(push.from_height)); ++y) {
        for (int x = max(begin.x, 0); x < min(begin.x + across, int(push.from_width)); ++x) {
            vec2 d = (vec2(x, y) + 0.5 - middle) / deviation;
            float weight = exp(-0.5 * dot(d, d));
            Beneath under = unpack_texel(from_texels[push.from_first + uint(y) * push.from_width + uint(x)]);
            // Raw second moments, until the means are known.
            under.covariance += dot(under.difference, under.render);
            under.variance += dot(under.render, under.render);
            add_texel(sum, weight, under);
            total += weight;
        }
    }
    vec3 difference = sum.difference / total, render = sum.render / total;
    float covariance = sum.covariance / total - dot(difference, render);
    float variance = max(sum.variance / total - dot(render, render), 0.0);
    texels[push.first + i] = pack_texel(Beneath(difference, render, covariance, variance));
}

#version 460
// Permutes a quad (four planes) of a segment's Gaussians: to fewer, to another order, or with copies.
//
// One thread takes one target; a dispatch takes the sources of one page. sources has for each target the
// number of its source, NONE if it starts at 0. sources, from (quads of the page, see shared/model.glsl) ->
// gathered (by target), which is then copied back, so that reads and writes never overlap.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"

layout(push_constant, scalar) uniform Push {
    uint count_index;  // index in count of the number of targets
    uint targets;      // capacity of gathered
    uint page_first;   // number in the segment of the page's first Gaussian
    uint stride;       // the page's capacity
    uint quad;         // number of the quad in the page
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Sources { uint sources[]; };
layout(set = 0, binding = 2, scalar) readonly buffer From { vec4 from[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer Gathered { vec4 gathered[]; };

void main() {
    uint target = thread_index();
    if (!(target < min(count[push.count_index], push.targets))) return;
    uint source = sources[target];
    bool fresh = source == NONE && push.page_first == 0;
    uint place = source - push.page_first;
    if (!fresh && !(source != NONE && source >= push.page_first && place < push.stride)) return;
    gathered[target] = fresh ? vec4(0.0) : from[push.quad * push.stride + place];
}

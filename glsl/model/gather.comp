#version 460
// Moves a quad of a segment's Gaussians, four planes, to new numbers: to fewer, in another order, or some of them several times.
//
// One thread takes one target; a dispatch takes the sources of one page. sources says by target which number it comes from, NONE
// where it begins at 0. sources, from (quads of the page, see shared/model.glsl) -> gathered (by target), which is then copied back:
// what is read and what is written never meet.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"

layout(push_constant, scalar) uniform Push {
    uint count_index;  // where count holds the number of targets
    uint targets;      // capacity of gathered
    uint page_first;   // number in the segment of the page's first Gaussian
    uint stride;       // the page's capacity
    uint quad;         // of those of the page
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

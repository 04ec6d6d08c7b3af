#version 460
// Renumbers the Gaussians that stay, preserving their order.
//
// One thread takes one Gaussian of a page. words, alive, ranks (number of alive Gaussians before it) ->
// sources. If all stay (see density_plan), each keeps its number.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/density.glsl"

layout(push_constant, scalar) uniform Push {
    uint page_first;
    uint stride;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Words { uint words[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Alive { uint alive[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Ranks { uint ranks[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer Sources { uint sources[]; };

void main() {
    uint place = thread_index(), number = push.page_first + place;
    if (!(place < push.stride && number < words[OLD])) return;
    if (words[ALIVE] == words[OLD]) sources[number] = number;
    else if (alive[number] != 0) sources[ranks[number]] = number;
}

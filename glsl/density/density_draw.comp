#version 460
// Draws the parent of each child.
//
// One thread takes one child. words, order -> sources (for numbers from ALIVE on: the parent's old number),
// copies (by old number: its number of children; 0 before). With REPLACEMENT, order holds the start of each
// Gaussian's weight in the sum CANDIDATES, and a hash of child and step falls into one of these. Without,
// order holds candidates by key, and child j comes from candidate j.
// Only integers are added, so the order of threads does not matter.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/density.glsl"
#include "../shared/hash.glsl"

layout(constant_id = 1) const bool REPLACEMENT = false;

layout(push_constant, scalar) uniform Push { uint step; uint seed; } push;

layout(set = 0, binding = 0, scalar) readonly buffer Words { uint words[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Order { uint order[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer Sources { uint sources[]; };
layout(set = 0, binding = 3, scalar) buffer Copies { uint copies[]; };

void main() {
    uint child = thread_index();
    if (!(child < words[CHILDREN])) return;
    uint parent;
    if (REPLACEMENT) {
        uint high, low;
        umulExtended(pcg4d(uvec4(child, push.step, HASH_DRAW, push.seed)).x, words[CANDIDATES], high, low);
        // The last Gaussian that begins at `high` or before: one with no weight begins where the next does.
        uint first = 0, end = words[OLD];
        while (end - first > 1) {
            uint middle = first + (end - first) / 2;
            if (order[middle] <= high) first = middle;
            else end = middle;
        }
        parent = first;
    } else {
        parent = order[child];
    }
    sources[words[ALIVE] + child] = parent;
    atomicAdd(copies[parent], 1);
}

#version 460
// Finds where each tile's intersections begin and end in the sorted list.
//
// One thread takes one intersection and writes at the places where the tile changes. `tile_ranges` is zero before.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"

layout(push_constant, scalar) uniform Push {
    uint count_index; // where count holds the number of intersections
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer IsectTiles { uint isect_tiles[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer TileRanges { uvec2 tile_ranges[]; };

void main() {
    uint i = thread_index(), isects = count[push.count_index];
    if (i >= isects) return;
    uint tile = isect_tiles[i];
    if (i == 0 || isect_tiles[i - 1] != tile) tile_ranges[tile].x = i;
    if (i + 1 == isects || isect_tiles[i + 1] != tile) tile_ranges[tile].y = i + 1;
}

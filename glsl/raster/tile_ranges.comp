#version 460
// Finds each tile's range of intersections in the sorted list.
//
// One thread takes one tile and bisects the list: some 20 reads. A thread for each intersection would read
// the whole list.
// count, isect_tiles -> tile_ranges; for a tile without intersections both ends are the position where they
// would be
// With LISTED also tile_list, the tiles that blending would change, and their number, which must be 0 before:
// tiles with intersections, and tiles whose pixels still show some. tile_drawn records these. The old range
// cannot, since another thread writes its end.
// Limits: the order of the list differs from run to run; the results do not.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"

layout(constant_id = 1) const bool LISTED = false;

layout(push_constant, scalar) uniform Push {
    uint count_index; // index in count of the number of intersections
    uint tile_count;
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer IsectTiles { uint isect_tiles[]; };
layout(set = 0, binding = 2, scalar) writeonly buffer TileRanges { uvec2 tile_ranges[]; };
layout(set = 0, binding = 3, scalar) buffer TileDrawn { uint tile_drawn[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer TileList { uint tile_list[]; };
layout(set = 0, binding = 5, scalar) buffer TileListCount { uint tile_list_count[]; };

void main() {
    uint isects = count[push.count_index];
    uint tile = thread_index();
    if (tile >= push.tile_count) return;
    uint begin = 0;
    for (uint end = isects; begin < end;) {
        uint middle = begin + (end - begin) / 2;
        if (isect_tiles[middle] < tile) begin = middle + 1;
        else end = middle;
    }
    tile_ranges[tile].x = begin;
    if (tile > 0) tile_ranges[tile - 1].y = begin;
    if (tile + 1 == push.tile_count) tile_ranges[tile].y = isects;
    if (!LISTED) return;
    uint occupied = begin < isects && isect_tiles[begin] == tile ? 1 : 0;
    if (occupied != 0 || tile_drawn[tile] != 0) { // guard: tiles that something has left
        tile_list[atomicAdd(tile_list_count[0], 1)] = tile;
    }
    tile_drawn[tile] = occupied;
}

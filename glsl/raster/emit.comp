#version 460
// Lists the tiles of every visible splat in depth order; a Gaussian's slots are contiguous.
//
// One lane takes one splat. A splat of more than BIG tile rows is taken by its whole subgroup, one row to a
// lane, so that a Gaussian that fills the screen does not hold up its neighbours.
// global_from_rank, splats or packed_splats, rank_first_slot, tile_counts -> isect_tiles and, with DIRECT,
// isect_globals (by slot). Without DIRECT instead: rank_blocks, which start at 0 (shared/slots.glsl), and
// first_slot (by Gaussian index), the first index of its gradient's records.
// A splat has exactly the number of slots that projection counted. If emit finds more tiles, the surplus is
// dropped; if it finds fewer, each remaining slot gets the tile NONE, which the sort drops. Both kernels use
// the same arithmetic (shared/splat.glsl), but even one extra tile must not land in a neighbour's slot.
// Limits: on llvmpipe, images of up to 3840 x 2160, see UNROLL. Slots beyond `capacity` are not written;
// `dispatch_args` has raised the overflow flag by then.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/splat.glsl"
#include "../shared/packed_splat.glsl"
#include "../shared/frame.glsl"
#include "../shared/slots.glsl"

layout(constant_id = 1) const uint TILE_WIDTH = 8;
layout(constant_id = 2) const uint TILE_HEIGHT = 8;
layout(constant_id = 3) const bool BATCH = false;  // splats of many frames at once; splat_frames has each one's frame
layout(constant_id = 4) const bool DIRECT = false; // Gaussian indices are sorted, not slots
layout(constant_id = 5) const bool PACKED_SPLATS = false;

layout(push_constant, scalar) uniform Push {
    uint frame_first;     // the first frame, index in frames
    uint tiles_x;         // tiles in a row of each frame's grid
    uint tiles_per_frame;
    uint capacity;        // slots
    uint count_index; // index in count of the number of visible splats
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 2, scalar) readonly buffer GlobalFromRank { uint global_from_rank[]; };
layout(set = 0, binding = 3, scalar) readonly buffer RankFirstSlot { uint rank_first_slot[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 5, scalar) readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 6, scalar) readonly buffer SplatFrames { uint splat_frames[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer IsectTiles { uint isect_tiles[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer IsectGlobals { uint isect_globals[]; };
layout(set = 0, binding = 9, scalar) buffer RankBlocks { uvec2 rank_blocks[]; };
layout(set = 0, binding = 10, scalar) writeonly buffer FirstSlot { uint first_slot[]; };
layout(set = 0, binding = 11, scalar) readonly buffer PackedSplats { PackedSplat packed_splats[]; };

const int BIG = 8;
// llvmpipe silently ends a kernel's loops after 65,535 iterations of all its loops together. 8 lanes with
// splats that fill an image of 3840 x 2160 (270 rows of 480 tiles, 34 rows to a lane) would make 130,560 with
// one slot an iteration.
const uint UNROLL = 4; // guard: emit: several slots an iteration

// Writes the tiles of one row to the splat's slots. `slot` is the first of its `room` slots, `at` the row's
// offset in them.
void put(uint global, uint frame, ivec2 span, int row, uint slot, uint room, uint at) {
    uint row_first = frame * push.tiles_per_frame + uint(row) * push.tiles_x;
    for (int first = span.x; first <= span.y; first += int(UNROLL), at += UNROLL) {
        [[unroll]] for (uint k = 0; k < UNROLL; ++k) {
            if (first + int(k) <= span.y && at + k < room) { // guard: tiles as many as counted
                isect_tiles[slot + at + k] = row_first + uint(first) + k;
                if (DIRECT) isect_globals[slot + at + k] = global;
            }
        }
    }
}

// Records that the `room` slots from `slot` on belong to `rank`, in every stride-th block that begins there,
// from number `at` on. Uses atomics, as do the bits next to them.
void claim(uint rank, uint slot, uint room, uint at, uint stride) {
    if (DIRECT) return;
    uint first = (slot + SLOTS_PER_BLOCK - 1) / SLOTS_PER_BLOCK, end = (slot + room + SLOTS_PER_BLOCK - 1) / SLOTS_PER_BLOCK;
    for (uint block = first + at; block < end; block += stride) atomicExchange(rank_blocks[block].x, rank);
}

Splat from_lane(Splat s, uint lane) {
    return Splat(subgroupShuffle(s.shape, lane), subgroupShuffle(s.centre, lane));
}

void main() {
    uvec2 size = uvec2(0);
    if (!BATCH) size = uvec2(frames[push.frame_first].width, frames[push.frame_first].height); // early, as in project
    uint rank = thread_index();
    uvec2 tile = uvec2(TILE_WIDTH, TILE_HEIGHT);
    bool live = rank < count[push.count_index];
    uint global = 0, slot = 0, room = 0, frame = 0;
    Splat s;
    ivec2 rows = ivec2(1, 0);
    if (live) {
        global = global_from_rank[rank];
        slot = rank_first_slot[rank];
        room = slot < push.capacity ? min(tile_counts[global], push.capacity - slot) : 0; // guard: emit keeps within its room
        if (PACKED_SPLATS) {
            s = unpack_splat(packed_splats[global]);
        } else {
            s = splats[global];
        }
        if (BATCH) {
            frame = splat_frames[global];
            size = uvec2(frames[push.frame_first + frame].width, frames[push.frame_first + frame].height);
        }
        rows = tile_rows(s, tile, size);
        if (!DIRECT) {
            first_slot[global] = slot;
            if (room > 0) atomicOr(rank_blocks[slot / SLOTS_PER_BLOCK].y, ~1u & 1u << slot % SLOTS_PER_BLOCK);
        }
    }

    bool big = rows.y - rows.x >= BIG;
    if (live && !big) {
        claim(rank, slot, room, 0, 1);
        uint at = 0;
        for (int row = rows.x; row <= rows.y; ++row) {
            ivec2 span = tile_span(s, row, tile, size);
            put(global, frame, span, row, slot, room, at);
            at += uint(max(span.y - span.x + 1, 0));
        }
        for (; at < room; ++at) isect_tiles[slot + at] = NONE; // guard: slots without a tile
    }
    for (uvec4 left = subgroupBallot(live && big); any(notEqual(left, uvec4(0)));) {
        uint lane = subgroupBallotFindLSB(left);
        left[lane / 32] &= ~(1u << (lane % 32));
        Splat whole = from_lane(s, lane);
        ivec2 whole_rows = ivec2(subgroupShuffle(rows.x, lane), subgroupShuffle(rows.y, lane));
        uint whole_global = subgroupShuffle(global, lane), next = 0;
        uint whole_slot = subgroupShuffle(slot, lane), whole_room = subgroupShuffle(room, lane);
        uint whole_frame = subgroupShuffle(frame, lane), whole_rank = subgroupShuffle(rank, lane);
        uvec2 whole_size = uvec2(subgroupShuffle(size.x, lane), subgroupShuffle(size.y, lane));
        claim(whole_rank, whole_slot, whole_room, gl_SubgroupInvocationID, gl_SubgroupSize);
        for (int first = whole_rows.x; first <= whole_rows.y; first += int(gl_SubgroupSize)) {
            int row = first + int(gl_SubgroupInvocationID);
            ivec2 span = row <= whole_rows.y ? tile_span(whole, row, tile, whole_size) : ivec2(1, 0);
            uint width = uint(max(span.y - span.x + 1, 0));
            put(whole_global, whole_frame, span, row, whole_slot, whole_room, next + subgroupExclusiveAdd(width));
            next += subgroupAdd(width); // guard: emit: slots of a whole subgroup
        }
        // guard: slots without a tile of a whole subgroup
        for (uint at = next + gl_SubgroupInvocationID; at < whole_room; at += gl_SubgroupSize) isect_tiles[whole_slot + at] = NONE;
    }
}

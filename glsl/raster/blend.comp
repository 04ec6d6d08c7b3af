#version 460
// Blends each tile's splats front to back into color and transmittance.
//
// One subgroup takes one tile, see shared/tile.glsl; no workgroup barrier.
// tile_ranges, isect_slots, rank_blocks, global_from_rank, splats, splat_colors or packed_splats, depth_keys, scene_depths, tile_list,
// tile_list_count -> image (rgb with background, transmittance), median_ids
// Kerbl 2023, section 4. A pixel takes a Gaussian if and only if alpha >= 1/255, and stops before
// transmittance falls below 1e-4.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/unit.glsl"
#include "../shared/splat.glsl"
#include "../shared/packed_splat.glsl"
#include "../shared/frame.glsl"
#include "../shared/tile.glsl"
#include "../shared/slots.glsl"

layout(constant_id = 5) const bool BACKGROUND_IMAGE = false; // the background is `backdrop`, not one color
layout(constant_id = 6) const bool MEDIAN = false;           // also record the Gaussian of median depth
layout(constant_id = 7) const bool OCCLUDED = false;         // splats behind `scene_depths` are hidden
layout(constant_id = 8) const bool DIRECT = false;           // `isect_slots` holds Gaussian indices, not slots
layout(constant_id = 9) const bool PACKED_SPLATS = false;

layout(push_constant, scalar) uniform Push {
    uint frame_first;      // the first frame, index in frames
    uint tiles_x;          // tiles in a row of each frame's grid
    uint tiles_per_frame;
    uint tile_count;       // over all frames
    vec3 background;       // rgb
    float median_threshold; // transmittance below which the median is reached
    vec2 depth_form;       // a depth d of `scene_depths` is at camera z = y / (d - x), see pipelines::frames::DepthForm
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer TileRanges { uvec2 tile_ranges[]; };
layout(set = 0, binding = 2, scalar) readonly buffer IsectSlots { uint isect_slots[]; };
layout(set = 0, binding = 3, scalar) readonly buffer RankBlocks { uvec2 rank_blocks[]; };
layout(set = 0, binding = 4, scalar) readonly buffer GlobalFromRank { uint global_from_rank[]; };
layout(set = 0, binding = 5, scalar) readonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 6, scalar) readonly buffer SplatColors { vec3 splat_colors[]; };
layout(set = 0, binding = 7, scalar) readonly buffer Backdrop { vec4 backdrop[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 9, scalar) writeonly buffer MedianIds { uint median_ids[]; };
layout(set = 0, binding = 10, scalar) readonly buffer DepthKeys { uint depth_keys[]; };
layout(set = 0, binding = 11, scalar) readonly buffer SceneDepths { float scene_depths[]; };
layout(set = 0, binding = 12, scalar) readonly buffer PackedSplats { PackedSplat packed_splats[]; };
layout(set = 0, binding = 13, scalar) readonly buffer TileList { uint tile_list[]; };
layout(set = 0, binding = 14, scalar) readonly buffer TileListCount { uint tile_list_count[]; };

// Camera z of the mesh surface in the depth buffer. FLOAT_MAX if there is none: the buffer then has its clear
// value, at any far plane (or a nonsensical one).
float occluder(uint at) {
    float d = scene_depths[at], z = push.depth_form.y / (d - push.depth_form.x);
    bool something = push.depth_form.y < 0.0 ? d < 1.0 : d > 0.0;
    return something && z > 0.0 && z <= FLOAT_MAX ? z : FLOAT_MAX; // guard: occluders of nothing
}

// The pixels of this lane.
float x;       // of the pixels' centres
uint corner_y; // first row of the tile
float T[PIXELS]; // negative if the pixel is finished; transmittance is the absolute value
vec3 color[PIXELS];
uint median[PIXELS];
float farthest[PIXELS]; // camera z

// A splat, as its lane has loaded it.
struct Loaded {
    vec4 shape; // see Splat
    vec2 centre;
    vec3 rgb;
    uint id;
    float depth;
};
Loaded own;
// On a GPU, each lane writes its splat here and all lanes read it, with three loads. With ten broadcasts in
// their place, the kernel took a tenth longer on an H200.
shared uvec4 loaded[3 * gl_WorkGroupSize.x];

void hand_out() {
    uint at = 3 * gl_LocalInvocationIndex;
    subgroupBarrier(); // the splats before have been taken
    loaded[at] = floatBitsToUint(own.shape);
    loaded[at + 1] = uvec4(floatBitsToUint(own.centre), own.id, floatBitsToUint(own.depth));
    loaded[at + 2] = uvec4(floatBitsToUint(own.rgb), 0);
    subgroupBarrier();
}

// The splat of lane `j`.
Loaded splat_of(uint j) {
    if (UNROLLED) {
        return Loaded(handed(own.shape, j), handed(own.centre, j), handed(own.rgb, j), handed(own.id, j), handed(own.depth, j));
    }
    uint at = 3 * (gl_SubgroupID * gl_SubgroupSize + j);
    uvec4 more = loaded[at + 1];
    return Loaded(uintBitsToFloat(loaded[at]), uintBitsToFloat(more.xy), uintBitsToFloat(loaded[at + 2].xyz), more.z,
                  uintBitsToFloat(more.w));
}

// Blends the splat of lane `j` into the tile.
void take(uint j) {
    Loaded splat = splat_of(j);
    precise float u0 = splat.shape.x * (x - splat.centre.x);
    [[unroll]] for (uint k = 0; k < PIXELS; ++k) {
        float dy = float(corner_y + lane_y(k)) + 0.5 - splat.centre.y;
        Response e = respond(u0, splat.shape.y, splat.shape.z, dy, splat.shape.w);
        // All later splats are farther still.
        if (OCCLUDED && splat.depth > farthest[k]) T[k] = -abs(T[k]);
        // Selected instead of branched on: a branch would skip little.
        precise float next = T[k] * (1.0 - e.alpha);
        bool met = e.alpha >= ALPHA_MIN; // guard: α from 1/255 on
        bool taken = met && next >= T_MIN;
        color[k] += taken ? e.alpha * T[k] * splat.rgb : vec3(0.0);
        T[k] = taken ? next : met ? -abs(T[k]) : T[k];
        if (MEDIAN) median[k] = taken && median[k] == NONE && next < push.median_threshold ? splat.id : median[k];
    }
}

void main() {
    uint index = subgroup_index();
    if (index >= (LISTED ? tile_list_count[0] : push.tile_count)) return;
    if (LISTED) index = tile_list[index];
    Frame frame = frames[push.frame_first + index / push.tiles_per_frame];
    uint tile = index % push.tiles_per_frame;
    uvec2 corner = uvec2(tile % push.tiles_x * TILE_WIDTH, tile / push.tiles_x * TILE_HEIGHT);
    if (corner.x >= frame.width || corner.y >= frame.height) return;

    uint px = corner.x + lane_x();
    x = float(px) + 0.5;
    corner_y = corner.y;
    [[unroll]] for (uint k = 0; k < PIXELS; ++k) {
        T[k] = -1.0;
        color[k] = vec3(0.0);
        median[k] = NONE;
        farthest[k] = FLOAT_MAX;
        uint py = corner.y + lane_y(k);
        if (px < frame.width && py < frame.height) {
            T[k] = 1.0;
            if (OCCLUDED) farthest[k] = occluder(frame.image_first + py * frame.width + px);
        }
    }

    uvec2 range = tile_ranges[index];
    for (uint first = range.x; first < range.y; first += gl_SubgroupSize) {
        float most = T[0];
        [[unroll]] for (uint k = 1; k < PIXELS; ++k) most = max(most, T[k]);
        if (subgroupAll(most < 0.0)) break;
        uint mine = first + gl_SubgroupInvocationID;
        // Lanes beyond the range have opacity 0: no pixel takes them.
        own = Loaded(vec4(0.0), vec2(0.0), vec3(0.0), 0, 0.0);
        if (mine < range.y) {
            uint global = isect_slots[mine];
            if (!DIRECT) global = global_from_rank[rank_of(rank_blocks[global / SLOTS_PER_BLOCK], global)];
            Splat splat;
            if (PACKED_SPLATS) {
                PackedSplat packed = packed_splats[global];
                splat = unpack_splat(packed);
                own.rgb = unpack_color(packed);
            } else {
                splat = splats[global];
                own.rgb = splat_colors[global];
            }
            own.shape = splat.shape;
            own.centre = splat.centre;
            if (MEDIAN) own.id = global;
            if (OCCLUDED) own.depth = uintBitsToFloat(depth_keys[global]);
        }
        if (UNROLLED) {
            [[unroll]] for (uint j = 0; j < LANES; ++j) take(j);
        } else {
            hand_out();
            uint n = min(gl_SubgroupSize, range.y - first);
            for (uint j = 0; j < n; ++j) take(j);
        }
    }

    [[unroll]] for (uint k = 0; k < PIXELS; ++k) {
        uint py = corner.y + lane_y(k);
        if (px < frame.width && py < frame.height) { // guard: pixels outside are not written
            uint at = frame.image_first + py * frame.width + px;
            vec3 behind = BACKGROUND_IMAGE ? backdrop[at].rgb : push.background;
            float passed = abs(T[k]);
            image[at] = vec4(color[k] + passed * behind, passed);
            if (MEDIAN) median_ids[at] = median[k];
        }
    }
}

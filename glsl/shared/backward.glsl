// Gradients of the blended image for each intersection: the body of blend_backward and blend_backward_atomic,
// which differ only in `put`, the destination of a record.
//
// One subgroup takes one tile, see shared/tile.glsl. It goes front to back again with the forward pass's
// arithmetic, so every decision is the same bit for bit and transmittance is never divided back. The color
// behind a Gaussian is the final color less the color passed so far. Sums over a tile's pixels are subgroup
// reductions.
// The record is in whitened coordinates, see docs/design-notes.md. With SCORES, image_grad comes from
// density_image, and only the first two components of `color` are summed, by blend weight. The rest of the
// record then compiles to nothing.
#include "common.glsl"
#include "splat.glsl"
#include "frame.glsl"
#include "population.glsl"
#include "tile.glsl"
#include "slots.glsl"

layout(constant_id = 5) const bool SCORES = false;

// Called with the record of every intersection that some pixel blends. If the Gaussian learns only its
// opacity, only `centre` is valid, see records.glsl.
struct Record {
    vec3 centre, shape, color;
};
void put(uint slot, uint global, bool all, Record record);

layout(push_constant, scalar) uniform Push {
    uint frame_first;
    uint tiles_x;
    uint tiles_per_frame;
    uint tile_count;
    uint frozen; // segments, from the first on, that need only the gradient of their opacity, and whether they are blended
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer TileRanges { uvec2 tile_ranges[]; };
layout(set = 0, binding = 2, scalar) readonly buffer IsectSlots { uint isect_slots[]; };
layout(set = 0, binding = 3, scalar) readonly buffer RankBlocks { uvec2 rank_blocks[]; };
layout(set = 0, binding = 4, scalar) readonly buffer GlobalFromRank { uint global_from_rank[]; };
layout(set = 0, binding = 5, scalar) readonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 6, scalar) readonly buffer SplatColors { vec3 splat_colors[]; };
layout(set = 0, binding = 7, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 8, scalar) readonly buffer ImageGrad { float image_grad[]; };
layout(set = 0, binding = 9, scalar) readonly buffer Population { uint segment_first[]; };
layout(set = 0, binding = 10, scalar) readonly buffer TileList { uint tile_list[]; };
layout(set = 0, binding = 11, scalar) readonly buffer TileListCount { uint tile_list_count[]; };

// The pixels of this lane.
float x;       // of the pixels' centres
uint corner_y; // first row of the tile
uint live;     // a bit for each pixel that is not finished
float T[PIXELS];
float behind[PIXELS]; // image_grad . (color that is still to come, background included)
vec3 grad[PIXELS];
// The splat that this lane has loaded, and its record.
Splat own;
vec3 tint;
bool learns; // all its parameters learn
Record record;
bool blended;

// Adds up the gradient of the splat of lane `j` over all pixels of the tile.
void take(uint j) {
    vec2 centre = handed(own.centre, j);
    vec4 shape = handed(own.shape, j);
    vec3 rgb = handed(tint, j);
    bool all = handed(uint(learns), j) != 0;
    precise float u0 = shape.x * (x - centre.x);
    vec2 sum_w = vec2(0.0);
    vec3 sum_ww = vec3(0.0), sum_rgb = vec3(0.0);
    float sum_opacity = 0.0;
    bool touched = false;
    [[unroll]] for (uint k = 0; k < PIXELS; ++k) {
        float dy = float(corner_y + lane_y(k)) + 0.5 - centre.y;
        Response e = respond(u0, shape.y, shape.z, dy, shape.w);
        bool met = (live >> k & 1u) != 0 && e.alpha >= ALPHA_MIN;
        // If no lane takes a row of pixels, a GPU skips much work here. All lanes of a CPU go along, and a
        // pixel that is not taken adds 0.
        if (!(UNROLLED || met)) continue;
        precise float next = T[k] * (1.0 - e.alpha);
        bool taken = met && next >= T_MIN;
        bool shaped = taken && e.alpha < ALPHA_MAX; // guard: no shape where α is clamped
        live &= ~(uint(met && !taken) << k);
        touched = touched || taken;
        float alpha = taken ? e.alpha : 0.0;
        float share = alpha * T[k], pull = dot(grad[k], rgb);
        behind[k] -= share * pull;
        float g_alpha = T[k] * pull - behind[k] / (1.0 - alpha);
        T[k] = taken ? next : T[k];
        vec2 w = shaped ? vec2(e.u, e.v) : vec2(0.0);
        vec2 w_g = g_alpha * alpha * w;
        sum_rgb += share * grad[k];
        sum_opacity += shaped ? g_alpha * e.weight : 0.0;
        sum_w += w_g;
        sum_ww += vec3(w_g.x * w.x, w_g.x * w.y, w_g.y * w.y);
    }
    bool blends = UNROLLED ? summed(touched ? 1.0 : 0.0) > 0.0 : subgroupAny(touched);
    if (!(UNROLLED || blends)) return;
    // The x component of a frozen Gaussian's record says that it is blended, which SparseAdam needs.
    // guard: blended without a gradient
    Record total = Record(vec3(1.0, 0.0, 0.0), vec3(0.0), vec3(0.0));
    if (SCORES) {
        total.color.xy = summed(sum_rgb.xy);
    } else {
        total.centre.z = summed(sum_opacity);
    }
    if (!SCORES && all) {
        total.centre.xy = summed(sum_w);
        total.shape = summed(sum_ww);
        total.color = summed(sum_rgb);
    }
    if (gl_SubgroupInvocationID == j) {
        record = total;
        blended = blends;
    }
}

void tile_backward() {
    uint index = subgroup_index();
    if (index >= (LISTED ? tile_list_count[0] : push.tile_count)) return;
    if (LISTED) index = tile_list[index];
    Frame frame = frames[push.frame_first + index / push.tiles_per_frame];
    uint tile = index % push.tiles_per_frame;
    uvec2 corner = uvec2(tile % push.tiles_x * TILE_WIDTH, tile / push.tiles_x * TILE_HEIGHT);
    if (corner.x >= frame.width || corner.y >= frame.height) return;

    uvec2 range = tile_ranges[index];
    if (range.x == range.y) return;
    uint px = corner.x + lane_x();
    x = float(px) + 0.5;
    corner_y = corner.y;
    live = 0;
    [[unroll]] for (uint k = 0; k < PIXELS; ++k) {
        T[k] = 1.0;
        behind[k] = 0.0;
        grad[k] = vec3(0.0);
        uint py = corner.y + lane_y(k);
        if (px < frame.width && py < frame.height) { // guard: pixels outside do not pull
            uint at = frame.image_first + py * frame.width + px;
            grad[k] = vec3(image_grad[3 * at], image_grad[3 * at + 1], image_grad[3 * at + 2]);
            behind[k] = dot(grad[k], image[at].rgb);
            live |= 1u << k;
        }
    }

    uint all_first = segment_first[push.frozen];
    for (uint first = range.x; first < range.y && subgroupAny(live != 0); first += gl_SubgroupSize) {
        uint mine = first + gl_SubgroupInvocationID, slot = 0, global = 0;
        // Lanes beyond the range have opacity 0: no pixel takes them.
        own = Splat(vec4(0.0), vec2(0.0));
        tint = vec3(0.0);
        learns = false;
        if (mine < range.y) {
            slot = isect_slots[mine];
            global = global_from_rank[rank_of(rank_blocks[slot / SLOTS_PER_BLOCK], slot)];
            own = splats[global];
            tint = splat_colors[global];
            learns = global >= all_first;
        }
        blended = false;
        if (UNROLLED) {
            [[unroll]] for (uint j = 0; j < LANES; ++j) take(j);
        } else {
            uint n = min(gl_SubgroupSize, range.y - first);
            for (uint j = 0; j < n; ++j) take(j);
        }
        if (blended) put(slot, global, learns, record);
    }
}

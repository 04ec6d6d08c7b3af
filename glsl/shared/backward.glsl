// Gradients of the blended image by intersection: the body of blend_backward and blend_backward_atomic, which differ in where
// a record goes (`put`).
//
// One subgroup takes one tile, see shared/tile.glsl, and goes front to back again with the forward pass's arithmetic, so
// every decision is the same bit for bit and no transmittance is divided back. What lies behind a Gaussian is the final
// colour less what has been passed. Sums over a tile's pixels are subgroup reductions.
// The record is in whitened coordinates, see ARCHITECTURE.md.
#include "common.glsl"
#include "splat.glsl"
#include "frame.glsl"
#include "population.glsl"
#include "tile.glsl"

// Called with the record of every intersection that some pixel blends; of a Gaussian whose opacity alone learns only `centre`
// is meant, see records.glsl.
struct Record {
    vec3 centre, shape, colour;
};
void put(uint slot, uint global, bool all, Record record);

layout(push_constant, scalar) uniform Push {
    uint frame_first;
    uint tiles_x;
    uint tiles_per_frame;
    uint tile_count;
    uint frozen; // segments, from the first on, that need the gradient of their opacity only, and whether they are blended
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer TileRanges { uvec2 tile_ranges[]; };
layout(set = 0, binding = 2, scalar) readonly buffer IsectSlots { uint isect_slots[]; };
layout(set = 0, binding = 3, scalar) readonly buffer GlobalFromSlot { uint global_from_slot[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 5, scalar) readonly buffer SplatColours { vec3 splat_colours[]; };
layout(set = 0, binding = 6, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 7, scalar) readonly buffer ImageGrad { float image_grad[]; };
layout(set = 0, binding = 8, scalar) readonly buffer Population { uint segment_first[]; };

void tile_backward() {
    uint index = subgroup_index();
    if (index >= push.tile_count) return;
    Frame frame = frames[push.frame_first + index / push.tiles_per_frame];
    uint tile = index % push.tiles_per_frame;
    uvec2 corner = uvec2(tile % push.tiles_x * TILE_WIDTH, tile / push.tiles_x * TILE_HEIGHT);
    if (corner.x >= frame.width || corner.y >= frame.height) return;

    uint px = corner.x + lane_x();
    float x = float(px) + 0.5;
    float T[PIXELS];
    float behind[PIXELS]; // image_grad . (colour that is still to come, background included)
    vec3 grad[PIXELS];
    uint live = 0;
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
    uvec2 range = tile_ranges[index];
    for (uint first = range.x; first < range.y && subgroupAny(live != 0); first += gl_SubgroupSize) {
        uint mine = first + gl_SubgroupInvocationID, slot = 0, global = 0;
        Splat s;
        vec3 tint;
        if (mine < range.y) {
            slot = isect_slots[mine];
            global = global_from_slot[slot];
            s = splats[global];
            tint = splat_colours[global];
        }
        Record record = Record(vec3(0.0), vec3(0.0), vec3(0.0));
        bool blended = false;
        uint n = min(gl_SubgroupSize, range.y - first);
        for (uint j = 0; j < n; ++j) {
            float l11 = subgroupBroadcast(s.l11, j), l12 = subgroupBroadcast(s.l12, j), l22 = subgroupBroadcast(s.l22, j);
            float opacity = subgroupBroadcast(s.opacity, j), sy = subgroupBroadcast(s.y, j);
            vec3 rgb = subgroupBroadcast(tint, j);
            bool all = subgroupBroadcast(global, j) >= all_first;
            precise float u0 = l11 * (x - subgroupBroadcast(s.x, j));
            vec2 sum_w = vec2(0.0);
            vec3 sum_ww = vec3(0.0), sum_rgb = vec3(0.0);
            float sum_opacity = 0.0;
            bool touched = false;
            [[unroll]] for (uint k = 0; k < PIXELS; ++k) {
                float dy = float(corner.y + lane_y(k)) + 0.5 - sy;
                Response e = respond(u0, l12, l22, dy, opacity);
                if ((live >> k & 1u) != 0 && e.alpha >= ALPHA_MIN) {
                    precise float next = T[k] * (1.0 - e.alpha);
                    if (next < T_MIN) {
                        live &= ~(1u << k);
                    } else {
                        touched = true;
                        float share = e.alpha * T[k], pull = dot(grad[k], rgb);
                        behind[k] -= share * pull;
                        float g_alpha = T[k] * pull - behind[k] / (1.0 - e.alpha);
                        T[k] = next;
                        sum_rgb += share * grad[k];
                        if (e.alpha < ALPHA_MAX) { // guard: no shape where α is clamped
                            sum_opacity += g_alpha * e.weight;
                            float g = g_alpha * e.alpha;
                            sum_w += g * vec2(e.u, e.v);
                            sum_ww += g * vec3(e.u * e.u, e.u * e.v, e.v * e.v);
                        }
                    }
                }
            }
            if (subgroupAny(touched)) {
                // Of what is frozen x says that it is blended, which SparseAdam asks.
                // guard: blended without a gradient
                Record total = Record(vec3(1.0, 0.0, subgroupAdd(sum_opacity)), vec3(0.0), vec3(0.0));
                if (all) {
                    total.centre.xy = subgroupAdd(sum_w);
                    total.shape = subgroupAdd(sum_ww);
                    total.colour = subgroupAdd(sum_rgb);
                }
                if (gl_SubgroupInvocationID == j) {
                    record = total;
                    blended = true;
                }
            }
        }
        if (blended) put(slot, global, global >= all_first, record);
    }
}

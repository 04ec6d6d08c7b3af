// How a subgroup covers a tile, shared by blending and its backward pass.
//
// One subgroup takes one tile of TILE_WIDTH x TILE_HEIGHT pixels. A lane takes PIXELS of its pixels, in one
// column, so that the offset in x is computed once. TILE_WIDTH divides the subgroup size and TILE_WIDTH *
// TILE_HEIGHT = subgroup size * PIXELS.
// A lane loads one splat, then all lanes take the splats in turn. One load instruction thus loads as many
// splats as the subgroup has lanes.
layout(constant_id = 1) const uint TILE_WIDTH = 8;
layout(constant_id = 2) const uint TILE_HEIGHT = 8;
layout(constant_id = 3) const uint PIXELS = 8;
// Unrolls over a subgroup's splats: lane indices are constants, lanes exchange values by shuffles, and pixels
// have no branches. This suits a CPU.
layout(constant_id = 4) const bool UNROLLED = false;
// Takes only the tile_list_count[0] tiles of tile_list, see tile_ranges.
layout(constant_id = 10) const bool LISTED = false;
const uint LANES = TILE_WIDTH * TILE_HEIGHT / PIXELS;

uint lane_x() { return gl_SubgroupInvocationID % TILE_WIDTH; }
uint lane_y(uint k) { return gl_SubgroupInvocationID / TILE_WIDTH + k * (gl_SubgroupSize / TILE_WIDTH); }

// Lane `j`'s value, and the sum over lanes, both returned to every lane. llvmpipe goes from lane to lane for
// either, but shuffles by constants in one instruction.
#define HANDED(T) T handed(T x, uint j) { return UNROLLED ? subgroupShuffle(x, j) : subgroupBroadcast(x, j); }
HANDED(uint)
HANDED(float)
HANDED(vec2)
HANDED(vec3)
HANDED(vec4)

#define SUMMED(T) \
    T summed(T x) { \
        if (!UNROLLED) return subgroupAdd(x); \
        [[unroll]] for (uint bit = 0; bit < 6; ++bit) { \
            if (1u << bit < LANES) x += subgroupShuffle(x, gl_SubgroupInvocationID ^ 1u << bit); \
        } \
        return x; \
    }
SUMMED(float)
SUMMED(vec2)
SUMMED(vec3)

// A splat at one pixel. `precise`, so that the backward pass repeats every decision of the forward pass bit for bit.
struct Response {
    float u, v;   // whitened offset
    float weight; // exp(-|w|^2/2)
    float alpha;
};

Response respond(float u0, float l12, float l22, float dy, float opacity) {
    precise float u = fma(l12, dy, u0);
    precise float v = l22 * dy;
    precise float weight = exp(-0.5 * fma(u, u, v * v));
    precise float alpha = min(ALPHA_MAX, opacity * weight);
    return Response(u, v, weight, alpha);
}

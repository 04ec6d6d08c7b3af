#version 460
// Lists the loss's tiles that matter to the 2D Gaussians: those whose gradient is used, and those from which
// it is computed.
//
// One thread takes one slot. splats, tile_counts, screen_frames, frames -> forward_tiles, backward_tiles, their numbers in
// count[0] and count[1]; tile_marks (2 words a tile) must be 0, as count must.
// Only pixels that a Gaussian covers pass their gradient on, and that gradient depends only on the loss of
// pixels within the SSIM window's radius. So ssim_backward runs on tiles with a pixel of a bounding box, and
// ssim_forward on tiles with a pixel within 5 pixels of one. Tiles not listed keep old values, read only for
// gradients of pixels without a Gaussian.
// Limits: the order of a list differs from run to run; the results do not.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/frame.glsl"
#include "../shared/splat.glsl"

layout(constant_id = 1) const uint TILE = 32; // of the loss, px

layout(push_constant, scalar) uniform Push {
    uint count;           // slots
    uint tiles_per_frame; // of the loss
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 1, scalar) readonly buffer ScreenFrames { uint screen_frames[]; };
layout(set = 0, binding = 2, scalar) readonly buffer TileCounts { uint tile_counts[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Splats { Splat splats[]; };
layout(set = 0, binding = 4, scalar) buffer TileMarks { uint tile_marks[]; };
layout(set = 0, binding = 5, scalar) buffer Count { uint count[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer ForwardTiles { uint forward_tiles[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer BackwardTiles { uint backward_tiles[]; };

const float WINDOW_RADIUS = 5.0; // px

// First and last tile of the pixel centres within `reach` of `centre`.
uvec4 tiles_within(vec2 centre, vec2 reach, Frame frame) {
    vec2 last = vec2(frame.width, frame.height) - 1.0;
    // Clamped before the conversion: huge floats have no int.
    uvec2 low = uvec2(clamp(ceil(centre - reach - 0.5), vec2(0.0), last));
    uvec2 high = uvec2(clamp(floor(centre + reach - 0.5), vec2(0.0), last));
    return uvec4(low / TILE, high / TILE);
}

void main() {
    uint i = thread_index();
    if (i >= push.count || tile_counts[i] == 0) return; // guard: no tiles of unseen 2D Gaussians
    uint f = screen_frames[i];
    Frame frame = frames[f];
    Splat s = splats[i];
    // The ellipse's bounding box, wider than exact as in tile_span.
    float t = 2.0 * log(255.0 * s.shape.w);
    t += 1e-4 * (1.0 + abs(t));
    float root = sqrt(max(t, 0.0));
    // guard: reach of 2D Gaussians
    vec2 reach = vec2(root * length(s.shape.yz) / (s.shape.x * s.shape.z), root / s.shape.z) + 1e-3;
    uint across = (frame.width + TILE - 1) / TILE;
    for (uint k = 0; k < 2; ++k) {
        // guard: tiles around 2D Gaussians
        uvec4 box = tiles_within(s.centre, reach + (k == 0 ? WINDOW_RADIUS : 0.0), frame);
        for (uint y = box.y; y <= box.w; ++y) {
            for (uint x = box.x; x <= box.z; ++x) {
                uint tile = f * push.tiles_per_frame + y * across + x;
                if (atomicExchange(tile_marks[2 * tile + k], 1) != 0) continue; // guard: each tile once
                uint at = atomicAdd(count[k], 1);
                if (k == 0) {
                    forward_tiles[at] = tile;
                } else {
                    backward_tiles[at] = tile;
                }
            }
        }
    }
}

#version 460
// Gradient of (1 - SSIM_WEIGHT) * mean |x - y| + SSIM_WEIGHT * (1 - mean SSIM) by the rendered pixels of each frame.
//
// A workgroup takes one tile of TILE * TILE pixels and its border: thread (channel, run, row) filters the
// partials of a run along its row, STRIP rows at a time; they go through shared memory to thread (channel,
// column), which filters down the column. partials, image, targets -> image_grad, 3 per pixel. The derivative
// of |x - y| is 0 at x = y. If a pixel does not count, its whole gradient is 0.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "../shared/common.glsl"
#include "../shared/ssim.glsl"
#include "../shared/runs.glsl"

// Workgroup g takes tile tile_list[g] of the count[count_index] listed ones; tiles not listed keep their
// values.
layout(constant_id = 1) const bool TILE_LIST = false;
layout(constant_id = 2) const float SSIM_WEIGHT = 0.2;

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer TileList { uint tile_list[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Targets { uint targets[]; };
layout(set = 0, binding = 5, scalar) readonly buffer Partials { vec3 partials[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer ImageGrad { float image_grad[]; };

// Frames begin at frame_first. A tile's number is frame * tiles_per_frame + tile, with frames counted from
// there; tile_count is the number of tiles without a list.
layout(push_constant, scalar) uniform Push { uint frame_first; uint tiles_per_frame; uint tile_count; uint count_index; } push;

// Odd, so that neighbouring rows begin in different banks.
const uint PITCH = TILE + 1;
shared vec3 blurred[3 * STRIP * PITCH];
// Strips above the tile, and again below, that its border needs.
const int BORDER = (RADIUS + int(STRIP) - 1) / int(STRIP);

vec3 partial_at(Frame frame, uint frame_index, uint channel, ivec2 pixel) {
    vec3 partial = vec3(0);
    if (within(frame, pixel)) partial = partials[partial_index(frame, frame_index, push.tiles_per_frame, channel, pixel)];
    return partial;
}

void main() {
    uint tile = group_index();
    if (!(tile < (TILE_LIST ? count[push.count_index] : push.tile_count))) return;
    if (TILE_LIST) tile = tile_list[tile];
    uint frame_index = tile / push.tiles_per_frame;
    uint tile_in_frame = tile % push.tiles_per_frame;
    Frame frame = frames[push.frame_first + frame_index];
    if (!(tile_in_frame < tiles_of(frame))) return;
    ivec2 corner = ivec2(TILE * uvec2(tile_in_frame % tiles_across(frame), tile_in_frame / tiles_across(frame)));

    uint thread = gl_LocalInvocationIndex;
    uint channel = thread / TILE;
    bool live = channel < 3;
    uint row = thread % STRIP;
    uint run = thread % TILE / STRIP;
    bool filters = live && run < RUNS; // a run along a row
    uint column = thread % TILE;
    Filter3 down = EMPTY3;
    float scale = 1 / (3 * float(frame.width) * float(frame.height));

    for (int strip = -BORDER; strip < int(TILE / STRIP) + BORDER; strip++) {
        int top = corner.y + strip * int(STRIP);
        if (top >= int(frame.height) + RADIUS) break;
        if (filters) {
            ivec2 pixel = ivec2(corner.x + int(run * RUN) - RADIUS, top + int(row));
            uint at = (channel * STRIP + row) * PITCH + run * RUN;
            Filter3 along = EMPTY3;
            [[unroll]] for (uint step = 0; step < 2 * RADIUS; step++, pixel.x++) {
                feed(along, partial_at(frame, frame_index, channel, pixel));
            }
            for (uint piece = 0; piece < RUN; piece += PIECE) [[unroll]] for (uint k = 0; k < PIECE; k++, pixel.x++) {
                blurred[at++] = feed(along, partial_at(frame, frame_index, channel, pixel));
            }
        }
        barrier();
        if (live) {
            for (uint step = 0; step < STRIP; step++) {
                vec3 p = feed(down, blurred[(channel * STRIP + step) * PITCH + column]);
                // A row above the tile until the window of the tile's first row is complete.
                ivec2 pixel = ivec2(corner.x + int(column), top + int(step) - RADIUS);
                if (pixel.y >= corner.y && pixel.y < corner.y + int(TILE) && within(frame, pixel)) {
                    uint i = uint(pixel.y) * frame.width + uint(pixel.x);
                    float x = image[frame.image_first + i][channel];
                    uint target = targets[frame.target_first + i];
                    float y = target_channel(target, channel);
                    float ssim = p.x + 2 * (x - MIDDLE) * p.y + (y - MIDDLE) * p.z;
                    float gradient = scale * ((1 - SSIM_WEIGHT) * sign(x - y) - SSIM_WEIGHT * ssim);
                    // guard: masks: gradients
                    image_grad[3 * (frame.image_first + i) + channel] = counts(target) ? gradient : 0;
                }
            }
        }
        barrier();
    }
}

#version 460
// Computes SSIM and L1 of rendered frames against their targets, and the derivatives of SSIM by its blurred
// moments.
//
// A workgroup takes one tile of TILE * TILE pixels: thread (channel, column) walks down the tile and its
// border, filtering x, y, x^2 + y^2 and xy; STRIP rows at a time go through shared memory to thread (channel,
// run, row), which filters along the row.
// image, targets -> partials (see runs.glsl), tile_sums (sums of |x - y|, of (x - y)^2 and of SSIM over the
// tile's pixels and channels), and with LOSS_MAP the loss of each pixel, the mean over its channels. If a
// pixel does not count its loss is 0, so that no Gaussian is drawn for it.
//
// With S = A1 A2 / (B1 B2), A1 = 2 mx my + C1, A2 = 2 (E[xy] - mx my) + C2, B1 = mx^2 + my^2 + C1,
// B2 = E[x^2 + y^2] - mx^2 - my^2 + C2, the partials are p0 = dS/dmx (E fixed), p1 = dS/dE[x^2] = -S / B2 and
// p2 = dS/dE[xy] = 2 A1 / (B1 B2); so dS/dx = blur(p0) + 2 x blur(p1) + y blur(p2). In A2, B2 and dS/dx all moments are
// those of x - MIDDLE and y - MIDDLE.
// Float32: E[x^2 + y^2] is 1/2 at most and has an error of some 6e-8, against a B2 of 9e-4 or more: 1e-4 of
// S, p1 and p2 if a picture is flat. p0 is computed from the rounded p1 and p2, so that their errors only
// scale x - mx in the gradient.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "../shared/common.glsl"
#include "../shared/ssim.glsl"
#include "../shared/runs.glsl"

// Workgroup g takes tile tile_list[g] of the count[count_index] listed ones; tiles not listed keep their
// values.
layout(constant_id = 1) const bool TILE_LIST = false;
layout(constant_id = 2) const float SSIM_WEIGHT = 0.2;
// Also writes loss_map.
layout(constant_id = 3) const bool LOSS_MAP = false;

layout(set = 0, binding = 0, scalar) readonly buffer Count { uint count[]; };
layout(set = 0, binding = 1, scalar) readonly buffer TileList { uint tile_list[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Targets { uint targets[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer Partials { vec3 partials[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer TileSums { vec3 tile_sums[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer LossMap { float loss_map[]; };

// Frames begin at frame_first. A tile's number is frame * tiles_per_frame + tile, with frames counted from
// there; tile_count is the number of tiles without a list.
layout(push_constant, scalar) uniform Push { uint frame_first; uint tiles_per_frame; uint tile_count; uint count_index; } push;

const uint COLUMNS = TILE + 2 * RADIUS;
// A channel has one vec4 more than its rows, so that the second half of the rows begins one later: rows then
// begin in different banks. Strips of 8 rows fit into the 16,384 bytes that Vulkan guarantees.
const uint CHANNEL = STRIP * COLUMNS + 1;
shared vec4 moments[3 * CHANNEL];
// First index of a channel's row in `moments`.
uint row_first(uint channel, uint row) { return channel * CHANNEL + row * COLUMNS + row / (STRIP / 2); }

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
    uint column_channel = thread / COLUMNS;
    ivec2 column = corner + ivec2(int(thread % COLUMNS) - RADIUS, -RADIUS);
    bool own_column = column.x >= corner.x && column.x < corner.x + int(TILE);
    Filter4 down = EMPTY4;

    // With a loss map one thread takes all channels of a run; without, each channel has its own threads.
    uint row = thread % STRIP;
    uint run = thread / STRIP % RUNS;
    uint first_channel = LOSS_MAP ? 0 : thread / (STRIP * RUNS);
    uint end_channel = LOSS_MAP ? (thread < STRIP * RUNS ? 3 : 0) : min(first_channel + 1, 3);

    float l1 = 0;
    float squares = 0;
    float ssim = 0;
    for (uint strip = 0; strip < TILE / STRIP && corner.y + int(strip * STRIP) < int(frame.height); strip++) {
        if (column_channel < 3) {
            // The first strip has to fill the window first.
            uint fed = strip == 0 ? STRIP + 2 * RADIUS : STRIP;
            for (uint step = 0; step < fed; step++) {
                float x = -MIDDLE;
                float y = -MIDDLE;
                if (within(frame, column)) {
                    uint pixel = uint(column.y) * frame.width + uint(column.x);
                    uint target = targets[frame.target_first + pixel];
                    x += image[frame.image_first + pixel][column_channel];
                    y += target_channel(target, column_channel);
                    if (!counts(target)) x = y; // guard: masks: windows
                }
                bool own_row = column.y >= corner.y && column.y < corner.y + int(TILE);
                if (own_column && own_row) {
                    l1 += abs(x - y);
                    squares += (x - y) * (x - y);
                }
                column.y += 1;
                vec4 done = feed(down, vec4(x, y, x * x + y * y, x * y));
                if (step + STRIP >= fed) {
                    uint at = row_first(column_channel, step + STRIP - fed) + thread % COLUMNS;
                    moments[at] = done;
                }
            }
        }
        barrier();
        float pixel_loss[RUN];
        if (LOSS_MAP) [[unroll]] for (uint step = 0; step < RUN; step++) pixel_loss[step] = 0;
        for (uint channel = first_channel; channel < end_channel; channel++) {
            Filter4 along = EMPTY4;
            uint at = row_first(channel, row) + run * RUN;
            [[unroll]] for (uint step = 0; step < 2 * RADIUS; step++) feed(along, moments[at + step]);
            ivec2 pixel = corner + ivec2(run * RUN, strip * STRIP + row);
            uint partial = partial_index(frame, frame_index, push.tiles_per_frame, channel, pixel);
            for (uint piece = 0; piece < RUN; piece += PIECE) [[unroll]] for (uint k = 0; k < PIECE; k++) {
                uint step = piece + k;
                vec4 m = feed(along, moments[at + 2 * RADIUS + step]);
                float mx = m.x + MIDDLE;
                float my = m.y + MIDDLE;
                float a1 = 2 * mx * my + C1;
                float a2 = 2 * (m.w - m.x * m.y) + C2;
                float b1 = mx * mx + my * my + C1;
                float b2 = m.z - m.x * m.x - m.y * m.y + C2;
                float s = a1 * a2 / (b1 * b2);
                float p1 = -s / b2;
                float p2 = 2 * a1 / (b1 * b2);
                float p0 = 2 * (my * a2 / b2 - mx * s) / b1 - 2 * m.x * p1 - m.y * p2;
                if (within(frame, pixel + ivec2(step, 0))) {
                    ssim += s;
                    partials[partial] = vec3(p0, p1, p2);
                    if (LOSS_MAP) {
                        uint i = uint(pixel.y) * frame.width + uint(pixel.x) + step;
                        uint target = targets[frame.target_first + i];
                        float x = image[frame.image_first + i][channel];
                        float y = target_channel(target, channel);
                        // guard: masks: loss map
                        if (counts(target)) pixel_loss[step] += (1 - SSIM_WEIGHT) * abs(x - y) + SSIM_WEIGHT * (1 - s);
                    }
                }
                partial += RUNS * STRIP;
            }
        }
        if (LOSS_MAP && end_channel == 3) {
            ivec2 pixel = corner + ivec2(run * RUN, strip * STRIP + row);
            [[unroll]] for (uint step = 0; step < RUN; step++) {
                if (within(frame, pixel)) {
                    loss_map[frame.image_first + uint(pixel.y) * frame.width + uint(pixel.x)] = pixel_loss[step] / 3;
                }
                pixel.x += 1;
            }
        }
        barrier();
    }

    vec3 sums = vec3(subgroupAdd(l1), subgroupAdd(squares), subgroupAdd(ssim));
    // No thread reads moments after the last barrier.
    if (subgroupElect()) moments[gl_SubgroupID].xyz = sums;
    barrier();
    if (thread == 0) {
        for (uint s = 1; s < gl_NumSubgroups; s++) sums += moments[s].xyz;
        tile_sums[tile] = sums;
    }
}

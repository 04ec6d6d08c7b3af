#version 460
// Draws pixels with high loss in each view, and places a new 2D Gaussian on each.
//
// One workgroup takes one view of the batch. Pixels are drawn without replacement, with probability in
// proportion to their squared loss: the m smallest of the keys -ln(u) / loss^2 (Efraimidis and Spirakis,
// "Weighted random sampling with a reservoir", 2006), u a hash of (seed, view, round, pixel). The m-th key is
// found digit by digit from histograms of its bits, so nothing is sorted; among equal keys the first pixels
// win. Drawn pixels in ascending order go to empty slots in ascending order, so every run gives the same
// result.
// m = min(max(1, round(budget / 5)), empty slots, pixels that can be drawn). (The method's round(0.2 n) is 0
// for n < 3, and such a view would never get its Gaussians.)
// loss_map, image, quotas, frames, screen_frames -> screen_planes, screen_frames, screen_ages,
// screen_moments, screen_states; drawn_pixels is scratch
// A view whose draw fills its budget has one more round, then waits.
// Limits: a pixel whose loss is NaN or outside 1e-18..1e18 (float32 cannot hold its square) is never drawn.
// Nothing changes once status says that a step did not fit.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/frame.glsl"
#include "../shared/status.glsl"
#include "../shared/screen.glsl"
#include "../shared/hash.glsl"

layout(push_constant, scalar) uniform Push {
    uint frame_count; // views in the batch
    uint stride;      // of the planes
    uint round;       // from 1
    uint seed;
    uint age;         // of new Gaussians: 0, or the number of steps of the views so far
} push;

layout(set = 0, binding = 0, scalar) readonly buffer Status { uint status[]; };
layout(set = 0, binding = 1, scalar) readonly buffer Frames { Frame frames[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Quotas { Quota quotas[]; };
layout(set = 0, binding = 3, scalar) readonly buffer LossMap { float loss_map[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Image { vec4 image[]; };
layout(set = 0, binding = 5, scalar) coherent buffer DrawnPixels { uint drawn_pixels[]; };
layout(set = 0, binding = 6, scalar) buffer ScreenStates { ScreenState screen_states[]; };
layout(set = 0, binding = 7, scalar) buffer ScreenFrames { uint screen_frames[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer ScreenPlanes { float screen_planes[]; };
layout(set = 0, binding = 9, scalar) writeonly buffer ScreenAges { uint screen_ages[]; };
layout(set = 0, binding = 10, scalar) writeonly buffer ScreenMoments { float screen_moments[]; };

const float LOSS_MIN = 1e-18, LOSS_MAX = 1e18;
const float FIRST_OPACITY_LOGIT = -3.89182029811063; // logit of 0.02
// The key's bits in three digits, highest first: 11, 11 and 10 bits.
const uint BINS = 2048, PASSES = 3;
const uint SHIFT[PASSES] = uint[](21, 10, 0), BITS[PASSES] = uint[](11, 11, 10);

// llvmpipe silently ends a kernel's loops after 65,535 iterations of all its loops together. Five passes over
// 3840 x 2160 pixels by 256 threads would be 162,000; four pixels at a time they are 40,500.
const uint UNROLL = 4; // guard: draw: several pixels an iteration

shared uint bins[BINS];
shared uvec2 subgroup_sums[gl_WorkGroupSize.x / 8]; // a subgroup has 8 lanes or more
shared uint found_bin, found_below, found_wanted;

uint hash(uint pixel, uint view) { return pcg4d(uvec4(pixel, view, push.round, push.seed)).w; }

// Bits of the key, which sort like the keys; NONE if the pixel cannot be drawn. `precise`: every pass must
// see the same key.
uint key_of(Frame frame, uint view, uint pixel) {
    float loss = loss_map[frame.image_first + pixel];
    if (!(loss >= LOSS_MIN && loss <= LOSS_MAX)) return NONE; // guard: 2D: losses that can be drawn
    uint h = hash(pixel, view);
    // -ln(u) for u = 1 - x, x = (h + 1/2) / 2^32. Drawn pixels have small x, for which 1 - x has few digits
    // in float32: a series is used there, exact to x^6/7 < 1e-8.
    precise float x = (float(h) + 0.5) / 4294967296.0;
    precise float series = x * (1.0 + x * (1.0 / 2.0 + x * (1.0 / 3.0 + x * (1.0 / 4.0 + x * (1.0 / 5.0 + x / 6.0)))));
    precise float key = (x < 0.0625 ? series : -log((float(~h) + 0.5) / 4294967296.0)) / (loss * loss);
    return floatBitsToUint(key);
}

// This subgroup's part of 0..count, as (first, end). The parts are consecutive, and none is longer than
// `longest`. Loops with subgroup operations run to `longest` in every subgroup: Vulkan promises that the
// lanes of a subgroup are together only if control flow is uniform in the workgroup.
uint longest(uint count) { return (count + gl_NumSubgroups - 1) / gl_NumSubgroups; }
uvec2 segment(uint count) {
    return min(uvec2(gl_SubgroupID, gl_SubgroupID + 1) * longest(count), uvec2(count));
}

// Sums over the lanes of all earlier subgroups (xy) and of the whole workgroup (zw).
uvec4 scan(uvec2 value) {
    uvec2 sum = uvec2(subgroupAdd(value.x), subgroupAdd(value.y));
    if (subgroupElect()) subgroup_sums[gl_SubgroupID] = sum;
    barrier();
    uvec4 total = uvec4(0);
    for (uint s = 0; s < gl_NumSubgroups; ++s) {
        if (s < gl_SubgroupID) total.xy += subgroup_sums[s];
        total.zw += subgroup_sums[s];
    }
    barrier();
    return total;
}

void main() {
    uint f = group_index();
    if (f >= push.frame_count) return;
    if (status[STATUS_FAILED] != 0) return; // guard: no drawing after an overflow
    uint mode = screen_states[f].mode;
    if (mode != DRAWING) {
        if (mode == FILLED && gl_LocalInvocationIndex == 0) screen_states[f].mode = WAITING;
        return;
    }
    Frame frame = frames[f];
    Quota quota = quotas[f];
    uint pixels = frame.width * frame.height, lane = gl_SubgroupInvocationID;

    uvec2 slots = segment(quota.budget);
    uint count = 0;
    for (uint s = slots.x + lane; s < slots.y; s += gl_SubgroupSize) count += uint(screen_frames[quota.first + s] == NONE);
    uvec4 empty = scan(uvec2(count, 0));
    uint wanted = min(max((quota.budget + 2) / 5, 1), empty.z);

    // Finds the key of rank `wanted` digit by digit, and the number of pixels below it.
    uint threshold = 0, below = 0;
    for (uint pass = 0; pass < PASSES && wanted > 0; ++pass) {
        for (uint b = gl_LocalInvocationIndex; b < BINS; b += gl_WorkGroupSize.x) bins[b] = 0;
        barrier();
        for (uint first = gl_LocalInvocationIndex; first < pixels; first += UNROLL * gl_WorkGroupSize.x) {
            [[unroll]] for (uint k = 0; k < UNROLL; ++k) {
                uint p = first + k * gl_WorkGroupSize.x, key = p < pixels ? key_of(frame, quota.view, p) : NONE;
                // Two shifts: the first pass has no higher digits, and a shift by 32 is undefined.
                if (key != NONE && key >> SHIFT[pass] >> BITS[pass] == threshold) {
                    atomicAdd(bins[key >> SHIFT[pass] & ((1u << BITS[pass]) - 1)], 1);
                }
            }
        }
        barrier();
        // Each thread takes neighbouring bins.
        uint each = (BINS + gl_WorkGroupSize.x - 1) / gl_WorkGroupSize.x;
        uint first_bin = min((gl_SubgroupID * gl_SubgroupSize + lane) * each, BINS), end_bin = min(first_bin + each, BINS);
        uint own = 0;
        for (uint b = first_bin; b < end_bin; ++b) own += bins[b];
        uint earlier = subgroupExclusiveAdd(own);
        uvec4 others = scan(uvec2(own, 0));
        // In the first pass others.z is the number of pixels that can be drawn; later passes have enough
        // anyway.
        uint rank = min(wanted, below + others.z), upto = below + others.x + earlier;
        for (uint b = first_bin; b < end_bin; ++b) {
            uint here = bins[b];
            upto += here;
            if (upto - here < rank && rank <= upto) {
                found_bin = b;
                found_below = upto - here;
            }
        }
        if (gl_LocalInvocationIndex == 0) found_wanted = rank;
        barrier();
        wanted = found_wanted;
        below = found_below;
        threshold = threshold << BITS[pass] | found_bin;
        barrier();
    }

    if (wanted > 0) {
        uint ties = wanted - below; // pixels with the threshold's own key that are drawn
        uvec2 range = segment(pixels), taken = uvec2(0);
        for (uint first = range.x + lane; first < range.y; first += UNROLL * gl_SubgroupSize) {
            [[unroll]] for (uint k = 0; k < UNROLL; ++k) {
                uint p = first + k * gl_SubgroupSize, key = p < range.y ? key_of(frame, quota.view, p) : NONE;
                taken += uvec2(key < threshold, key == threshold);
            }
        }
        uvec2 next = scan(taken).xy;
        for (uint first = 0; first < longest(pixels); first += UNROLL * gl_SubgroupSize) {
            [[unroll]] for (uint k = 0; k < UNROLL; ++k) {
                uint p = range.x + first + k * gl_SubgroupSize + lane, key = p < range.y ? key_of(frame, quota.view, p) : NONE;
                uvec4 less = subgroupBallot(key < threshold), equal = subgroupBallot(key == threshold);
                uint rank_less = next.x + subgroupBallotExclusiveBitCount(less);
                uint rank_equal = next.y + subgroupBallotExclusiveBitCount(equal);
                if (key < threshold || (key == threshold && rank_equal < ties)) {
                    drawn_pixels[quota.first + rank_less + min(rank_equal, ties)] = p;
                }
                next += uvec2(subgroupBallotBitCount(less), subgroupBallotBitCount(equal));
            }
        }
        // Orders other subgroups' drawn pixels before the reads below, and their reads of slots before the
        // writes.
        controlBarrier(gl_ScopeWorkgroup, gl_ScopeWorkgroup, gl_StorageSemanticsBuffer, gl_SemanticsAcquireRelease);

        float log_scale = log(first_scale(frame.width, frame.height));
        uint rank = empty.x;
        for (uint first = 0; first < longest(quota.budget); first += gl_SubgroupSize) {
            uint s = slots.x + first + lane, i = quota.first + s;
            bool free = s < slots.y && screen_frames[i] == NONE;
            uvec4 frees = subgroupBallot(free);
            uint r = rank + subgroupBallotExclusiveBitCount(frees);
            rank += subgroupBallotBitCount(frees);
            if (free && r < wanted) {
                uint p = drawn_pixels[quota.first + r];
                vec3 rgb = clamp(image[frame.image_first + p].rgb, vec3(0.0), vec3(1.0));
                screen_planes[CENTRE * push.stride + i] = float(p % frame.width) + 0.5;
                screen_planes[(CENTRE + 1) * push.stride + i] = float(p / frame.width) + 0.5;
                for (uint c = 0; c < 3; ++c) screen_planes[(COLOR + c) * push.stride + i] = rgb[c];
                screen_planes[LOGIT * push.stride + i] = FIRST_OPACITY_LOGIT;
                screen_planes[LOG_SCALE * push.stride + i] = log_scale;
                screen_planes[(LOG_SCALE + 1) * push.stride + i] = log_scale;
                screen_planes[ANGLE * push.stride + i] = 0.0;
                screen_planes[DEPTH * push.stride + i] = 0.0;
                for (uint m = 0; m < 2 * LEARNED; ++m) screen_moments[m * push.stride + i] = 0.0;
                screen_ages[i] = push.age;
                screen_frames[i] = f;
            }
        }
    }
    if (gl_LocalInvocationIndex == 0) {
        uint taken = quota.budget - empty.z + wanted;
        screen_states[f] = ScreenState(taken, taken < quota.budget ? DRAWING : FILLED);
    }
}

#version 460
// Converts the covered pixels of each 2D Gaussian to weighted 3D points (method, section 4.1).
//
// One subgroup takes one 2D Gaussian. Its lanes go through the bounding box in row-major order and ballots
// number the points, so points are in pixel order at any subgroup size.
// screen_planes, screen_frames, views, depths, point_counts, point_firsts -> points (xyz, weight),
// point_sets, labels, heaviest, taus.
//
// Points are in the frame of the view's camera: z is the pixel's depth, distances equal those in the world (a
// rigid motion), and no digits are lost if the scene lies far from its origin.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/view.glsl"
#include "../shared/footprint.glsl"
#include "../shared/screen.glsl"

layout(set = 0, binding = 0, scalar) readonly buffer ScreenPlanes { float screen_planes[]; };
layout(set = 0, binding = 1, scalar) readonly buffer ScreenFrames { uint screen_frames[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Views { View views[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Depths { float depths[]; };
layout(set = 0, binding = 4, scalar) readonly buffer PointCounts { uint point_counts[]; };
layout(set = 0, binding = 5, scalar) readonly buffer PointFirsts { uint point_firsts[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer Points { vec4 points[]; };
// Index within the set of the point of greatest weight; ties go to the lowest index.
layout(set = 0, binding = 7, scalar) writeonly buffer Heaviest { uint heaviest[]; };
// tau0 = 5*dd, dd = depth / fx: the distance at that depth of two horizontally adjacent pixels.
layout(set = 0, binding = 8, scalar) writeonly buffer Taus { float taus[]; };
// The 2D Gaussian of each point, and the point as its own component: the initial state of clustering.
layout(set = 0, binding = 9, scalar) writeonly buffer PointSets { uint point_sets[]; };
layout(set = 0, binding = 10, scalar) writeonly buffer Labels { uint labels[]; };

layout(push_constant, scalar) uniform Push {
    uint count;      // 2D Gaussians, including empty slots
    uint stride;     // of the planes
    uint view_count;
} push;

float at(uint p, uint i) { return screen_planes[p * push.stride + i]; }

const float TAU_PIXELS = 5.0; // appendix A: the first threshold is 5*dd

void main() {
    uint item = subgroup_index();
    if (item >= push.count) return;
    uint n = point_counts[item];
    uint v = screen_frames[item];
    if (n == 0 || v >= push.view_count) {
        if (subgroupElect()) {
            heaviest[item] = 0;
            taus[item] = 0.0;
        }
        return;
    }
    View view = views[v];
    uint first = point_firsts[item];
    Footprint f = make_footprint(vec2(at(CENTRE, item), at(CENTRE + 1, item)), at(LOGIT, item),
        vec2(at(LOG_SCALE, item), at(LOG_SCALE + 1, item)), at(ANGLE, item),
        uvec2(view.width, view.height), false);
    uint pixels = f.size.x * f.size.y;
    uint written = 0;
    float best_weight = 0.0;
    float best_depth = 0.0;
    uint best = 0;
    vec3 last = vec3(0.0); // this lane's last point, and its index
    uint last_at = NONE;
    for (uint base = 0; base < pixels; base += gl_SubgroupSize) {
        uint k = base + gl_SubgroupInvocationID;
        float weight = 0.0;
        float depth = 0.0;
        uvec2 pixel = f.low + uvec2(k % f.size.x, k / f.size.x);
        if (k < pixels) {
            weight = footprint_weight(f, pixel);
            if (weight > 0.0) depth = depths[view.pixel_first + pixel.y * view.width + pixel.x];
        }
        bool taken = weight > 0.0 && is_depth(depth);
        uvec4 ballot = subgroupBallot(taken);
        uint at = written + subgroupBallotExclusiveBitCount(ballot);
        // at < n holds because the count used the same arithmetic. Checked all the same: a misplaced point
        // would overwrite another set's.
        if (taken && at < n) { // guard: points within the count
            vec2 ray = (vec2(pixel) + 0.5 - vec2(view.cx, view.cy)) / vec2(view.fx, view.fy);
            last = vec3(ray * depth, depth);
            last_at = at;
            points[first + at] = vec4(last, weight);
            point_sets[first + at] = item;
            labels[first + at] = at;
            if (weight > best_weight) {
                best_weight = weight;
                best_depth = depth;
                best = at;
            }
        }
        written += subgroupBallotBitCount(ballot);
    }
    // If fewer points were found than counted, clustering must still find a point at each index: the last one
    // is repeated, without weight.
    // guard: points as many as counted (10 lines)
    if (written < n) {
        uvec4 ends = subgroupBallot(last_at != NONE && last_at + 1 == written);
        vec3 again = vec3(0.0);
        if (written > 0) again = subgroupShuffle(last, subgroupBallotFindLSB(ends));
        for (uint at = written + gl_SubgroupInvocationID; at < n; at += gl_SubgroupSize) {
            points[first + at] = vec4(again, 0.0);
            point_sets[first + at] = item;
            labels[first + at] = at;
        }
    }
    float top = subgroupMax(best_weight);
    uint winner = subgroupMin(best_weight == top ? best : 0xFFFFFFFFu);
    float winner_depth = subgroupMax(best_weight == top && best == winner ? best_depth : 0.0);
    if (subgroupElect()) {
        float centre_depth = at(DEPTH, item);
        heaviest[item] = winner;
        // guard: τ without a depth
        taus[item] = TAU_PIXELS * (is_depth(centre_depth) ? centre_depth : winner_depth) / view.fx;
    }
}

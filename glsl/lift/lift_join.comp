#version 460
// Joins the points of each open set that are closer than the set's tau, in the forest of `labels` (method, section 4.2).
//
// Cutting single linkage at distance tau is the partition into connected components of the graph that joins points closer than tau.
//
// One lane takes one point of the packed sets. A subgroup's points (a block of one set, or several blocks in
// turn if sets meet) are tested against all points of their set up to themselves. A point farther than tau
// from the block's box cannot join anything in it and is skipped, as is a point already in the component of
// the whole block. In pixel order few pairs are left; any other order gives the same result. Rounding is
// monotone, so the computed distance to the box is never above the computed distance to a point in it, and
// skipping is exact.
//
// points, point_sets, point_counts, point_firsts, taus, cluster_sizes -> labels: each an ancestor of its
// point, initially the point itself. Components only merge as tau grows, so the forest carries over from one
// round to the next.
//
// Limits: llvmpipe silently ends a kernel's loops after 65,535 iterations of all its loops together. A lane
// makes n/8 + (pairs left) iterations: sets of any size in pixel order (at most 87,000 points), some 50,000
// points in the worst order.
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/cluster.glsl"

layout(set = 0, binding = 0, scalar) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 1, scalar) readonly buffer PointSets { uint point_sets[]; };
layout(set = 0, binding = 2, scalar) readonly buffer PointCounts { uint point_counts[]; };
layout(set = 0, binding = 3, scalar) readonly buffer PointFirsts { uint point_firsts[]; };
layout(set = 0, binding = 4, scalar) readonly buffer Taus { float taus[]; };
layout(set = 0, binding = 5, scalar) readonly buffer ClusterSizes { uint cluster_sizes[]; };
layout(set = 0, binding = 6, scalar) buffer Labels { uint labels[]; };

layout(push_constant, scalar) uniform Push {
    uint point_count; // of all sets
} push;

#include "../shared/forest.glsl"

float squared_length(vec3 d) {
    precise float sum = d.x * d.x + d.y * d.y + d.z * d.z;
    return sum;
}

// Joins the points of one block with earlier points. `here`: this lane's point p, number `own` of the set,
// with the ancestor `mine`, is in the block.
void join_block(bool here, vec3 p, uint own, uint mine, uint first, uint n, float limit) {
    const float FAR = 3.402823466e38;
    uint lane = gl_SubgroupInvocationID, width = gl_SubgroupSize;
    vec3 low = subgroupMin(here ? p : vec3(FAR)), high = subgroupMax(here ? p : vec3(-FAR));
    uint last = subgroupMax(here ? own : 0);
    for (uint other = 0; other <= last; other += width) {
        uint theirs = min(other + lane, n - 1);
        vec3 q = points[first + theirs].xyz;
        // guard: points in another block
        bool near = other + lane < n && squared_length(max(max(low - q, q - high), vec3(0.0))) < limit;
        if (!subgroupAny(near)) continue;
        if (here) mine = find(first, mine);
        if (near) theirs = find(first, theirs);
        uint root = subgroupMin(here ? mine : NONE);
        bool one = subgroupAll(!here || mine == root);
        uvec4 left = subgroupBallot(near && !(one && theirs == root));
        while ((left.x | left.y) != 0u) {
            uint from = subgroupBallotFindLSB(left);
            if (from < 32u) left.x &= left.x - 1u; else left.y &= left.y - 1u;
            vec3 point = subgroupShuffle(q, from);
            uint label = subgroupShuffle(theirs, from);
            if (here && label != mine && squared_length(p - point) < limit) mine = unite(first, mine, label);
        }
    }
}

void main() {
    uint at = subgroup_index() * gl_SubgroupSize + gl_SubgroupInvocationID;
    bool open = at < push.point_count;
    // Read outside of all loops: if the first access to a buffer is in a loop, llvmpipe of Mesa 25.2 keeps
    // the buffer's address in lanes. It then reads at address 0 in a loop after one that the first lane did
    // not enter.
    uint ancestor = label_at(min(at, push.point_count - 1)); // a number of its set, like every label
    uint set_index = open ? point_sets[at] : NONE;
    vec3 p = vec3(0.0);
    if (open) {
        p = points[at].xyz;
        // A point that is not finite is close to nothing, and must not spoil the box.
        open = is_open(point_counts[set_index], taus[set_index], cluster_sizes[set_index]) && squared_length(p) < 3.402823466e38;
    }
    while (subgroupAny(open)) {
        uint current = subgroupMin(open ? set_index : NONE);
        bool here = open && set_index == current;
        uint first = point_firsts[current];
        float tau = taus[current];
        join_block(here, p, at - first, ancestor, first, point_counts[current], tau * tau);
        if (here) open = false;
    }
}

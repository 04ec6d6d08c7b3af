#version 460
// Foreground from background: single-linkage clustering of each set of points (method, section 4.2 and 4.3; Sibson 1973).
//
// Cutting single linkage at distance τ is the partition into connected components of the graph that joins points closer than τ.
// They are found by lock-free union-find: the larger root is hooked under the smaller one, so a component's root, its label, is
// its smallest member index however the lanes are scheduled. While clustering fails, τ ← 1.5 τ; components only ever merge
// as τ grows, so the forest is kept from one τ to the next.
//
// One subgroup: one set. It takes its points a subgroup's width at a time (a block: one point per lane) and meets each with
// itself and all blocks before it. Points of the other block farther than τ from this block's box cannot join
// anything in it and are passed over, as are those known to be in the one component that holds this whole block: for points in
// pixel order few pairs are left, and for any other order the result is the same. Rounding is monotone, so the
// computed distance to the box is never above the computed distance to a point in it, and passing over is exact.
//
// points, point_counts, point_firsts, heaviest, start_taus → labels (index within the set of the component's first point),
// group_sizes (scratch: size of component at its label), taus, prime_labels, cluster_sizes (of the prime group; 0: no lift).
//
// The prime group is the one of the heaviest point if it has 3 points or more, else the largest (ties: the smallest label).
// No lift: fewer than 3 points, τ0 not in (0, 1e18], or still failing after MAX_GROWTHS growths.

#extension GL_GOOGLE_include_directive : require

#include "../shared/common.glsl"

// ⚖ What failure is: 0, the largest group has fewer than 3 points; 1, the smallest has (listing 1 of the appendix).
layout(constant_id = 1) const uint FAIL_ON_SMALLEST = 0;

layout(set = 0, binding = 0, scalar) readonly buffer Points { vec4 points[]; };
layout(set = 0, binding = 1, scalar) readonly buffer PointCounts { uint point_counts[]; };
layout(set = 0, binding = 2, scalar) readonly buffer PointFirsts { uint point_firsts[]; };
layout(set = 0, binding = 3, scalar) readonly buffer Heaviest { uint heaviest[]; };
layout(set = 0, binding = 4, scalar) readonly buffer StartTaus { float start_taus[]; };
// Coherent: lanes of a subgroup read what other lanes wrote, which a cache that lanes do not share would hide.
layout(set = 0, binding = 5, scalar) coherent buffer Labels { uint labels[]; };
layout(set = 0, binding = 6, scalar) coherent buffer GroupSizes { uint group_sizes[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer Taus { float taus[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer PrimeLabels { uint prime_labels[]; };
layout(set = 0, binding = 9, scalar) writeonly buffer ClusterSizes { uint cluster_sizes[]; };

layout(push_constant, scalar) uniform Push {
    uint count; // sets
};

const float TAU_GROWTH = 1.5;
const uint GROUP_MIN = 3; // points: PCA needs three
// 1.5^64 = 2e11: from a few pixels to more than any ratio of lengths that float32 positions can tell apart (2^24 = 2e7),
// so a set that is still apart then holds points that have no meaning.
const uint MAX_GROWTHS = 64;

// The root of x, halving the path. Labels only ever fall, each to an ancestor, so a stale one is still an ancestor.
uint find(uint first, uint x) {
    while (true) {
        uint parent = labels[first + x];
        if (parent == x) return x;
        uint grandparent = labels[first + parent];
        if (grandparent == parent) return parent;
        atomicMin(labels[first + x], grandparent);
        x = grandparent;
    }
    return x;
}

// Joins the components of a and b; their common root as known here. A failed exchange means that another lane made progress.
uint unite(uint first, uint a, uint b) {
    while (true) {
        a = find(first, a);
        b = find(first, b);
        if (a == b) return a;
        uint low = min(a, b), high = max(a, b);
        if (atomicCompSwap(labels[first + high], high, low) == high) return low;
    }
    return a;
}

// Orders what the lanes of this subgroup write before from what they read after.
void meet() {
    subgroupMemoryBarrierBuffer();
    subgroupBarrier();
}

float squared_length(vec3 d) {
    precise float sum = d.x * d.x + d.y * d.y + d.z * d.z;
    return sum;
}

void join_closer_than(float tau, uint first, uint n) {
    float limit = tau * tau;
    uint lane = gl_SubgroupInvocationID, width = gl_SubgroupSize;
    for (uint block = 0; block < n; block += width) {
        bool here = block + lane < n;
        // Lanes past the end repeat the last point, so that the box is that of real points.
        uint mine = min(block + lane, n - 1);
        vec3 p = points[first + mine].xyz;
        vec3 low = subgroupMin(p), high = subgroupMax(p);
        for (uint other = 0; other <= block; other += width) {
            uint theirs = min(other + lane, n - 1);
            vec3 q = points[first + theirs].xyz;
            bool near = other + lane < n && squared_length(max(max(low - q, q - high), vec3(0.0))) < limit;
            if (!subgroupAny(near)) continue;
            mine = find(first, mine);
            if (near) theirs = find(first, theirs);
            uint root = subgroupBroadcastFirst(mine);
            bool one = subgroupAll(mine == root);
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
}

void main() {
    uint set_index = subgroup_index();
    if (set_index >= count) return;
    uint lane = gl_SubgroupInvocationID, width = gl_SubgroupSize;
    uint n = point_counts[set_index], first = point_firsts[set_index];
    float tau = start_taus[set_index];
    for (uint i = lane; i < n; i += width) labels[first + i] = i;

    uint prime = 0, size = 0;
    if (n >= GROUP_MIN && tau > 0.0 && tau <= 1e18) {
        meet();
        for (uint growth = 0; growth <= MAX_GROWTHS; growth += 1) {
            if (growth > 0) tau *= TAU_GROWTH;
            join_closer_than(tau, first, n);
            meet();
            for (uint i = lane; i < n; i += width) {
                atomicMin(labels[first + i], find(first, i));
                group_sizes[first + i] = 0;
            }
            meet();
            for (uint i = lane; i < n; i += width) atomicAdd(group_sizes[first + labels[first + i]], 1u);
            meet();

            uint largest = 0, smallest = 0xFFFFFFFFu, label = 0xFFFFFFFFu;
            for (uint i = lane; i < n; i += width) {
                uint members = group_sizes[first + i];
                if (members == 0) continue;
                smallest = min(smallest, members);
                if (members > largest) {
                    largest = members;
                    label = i;
                }
            }
            uint most = subgroupMax(largest);
            uint fewest = subgroupMin(smallest);
            if ((FAIL_ON_SMALLEST != 0 ? fewest : most) < GROUP_MIN) continue;

            prime = subgroupMin(largest == most ? label : 0xFFFFFFFFu);
            size = most;
            uint centre = labels[first + min(heaviest[set_index], n - 1)];
            uint around = group_sizes[first + centre];
            if (around >= GROUP_MIN) {
                prime = centre;
                size = around;
            }
            break;
        }
    }
    if (subgroupElect()) {
        taus[set_index] = tau;
        prime_labels[set_index] = prime;
        cluster_sizes[set_index] = size;
    }
}

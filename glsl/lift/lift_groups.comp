#version 460
// Evaluates the components of each open set and selects its prime group (method, section 4.2 and 4.3).
//
// One subgroup takes one set. Labels become the components' roots. If clustering failed, tau grows, and the
// set asks for another round of lift_join and of this stage: with `round` r, its numbers of workgroups go to
// words 6(r + 1) of `rounds` (0 before), for lift_join and, three words on, for this stage.
//
// labels, point_counts, point_firsts, heaviest -> labels (index within the set of the component's first point), group_sizes (scratch:
// size of a component at its label), taus, prime_labels, cluster_sizes (of the prime group; stays 0 while there is none), rounds.
//
// The prime group is the one of the heaviest point if it has 3 points or more, else the largest (ties: the smallest label).
#extension GL_GOOGLE_include_directive : require
#include "../shared/common.glsl"
#include "../shared/cluster.glsl"
#include "../shared/meet.glsl"

// ⚖ Failure means: 0, the largest group has fewer than 3 points; 1, the smallest has (listing 1 of the
// appendix).
layout(constant_id = 1) const uint FAIL_ON_SMALLEST = 0;

layout(set = 0, binding = 0, scalar) readonly buffer PointCounts { uint point_counts[]; };
layout(set = 0, binding = 1, scalar) readonly buffer PointFirsts { uint point_firsts[]; };
layout(set = 0, binding = 2, scalar) readonly buffer Heaviest { uint heaviest[]; };
layout(set = 0, binding = 3, scalar) buffer Labels { uint labels[]; };
layout(set = 0, binding = 4, scalar) buffer GroupSizes { uint group_sizes[]; };
layout(set = 0, binding = 5, scalar) buffer Taus { float taus[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer PrimeLabels { uint prime_labels[]; };
layout(set = 0, binding = 7, scalar) buffer ClusterSizes { uint cluster_sizes[]; };
layout(set = 0, binding = 8, scalar) buffer Rounds { uint rounds[]; };

layout(push_constant, scalar) uniform Push {
    uint count;       // sets
    uint point_count; // of all sets
    uint round;
    uint last_round;
} push;

#include "../shared/forest.glsl"

const float TAU_GROWTH = 1.5;
const uint MAX_GROUPS = 65535; // largest number that Vulkan guarantees in a dimension

uint group_size_at(uint i) {
    return atomicLoad(group_sizes[i], gl_ScopeDevice, gl_StorageSemanticsNone, gl_SemanticsRelaxed);
}

// Every set that asks writes the same words; atomically, since they do so at once.
void ask(uint word, uint groups_x, uint groups_y) {
    atomicMax(rounds[word], groups_x);
    atomicMax(rounds[word + 1], groups_y);
    atomicMax(rounds[word + 2], 1u);
}

void main() {
    uint set_index = subgroup_index();
    if (set_index >= push.count) return;
    uint lane = gl_SubgroupInvocationID, width = gl_SubgroupSize;
    uint n = point_counts[set_index], first = point_firsts[set_index];
    float tau = taus[set_index];
    if (!is_open(n, tau, cluster_sizes[set_index])) return;

    for (uint i = lane; i < n; i += width) {
        atomicMin(labels[first + i], find(first, i));
        atomicStore(group_sizes[first + i], 0u, gl_ScopeDevice, gl_StorageSemanticsNone, gl_SemanticsRelaxed);
    }
    // Each lane reads other lanes' earlier writes to buffers, which a subgroup barrier also orders.
    subgroup_meets();
    for (uint i = lane; i < n; i += width) atomicAdd(group_sizes[first + label_at(first + i)], 1u);
    subgroup_meets();
    uint largest = 0, smallest = NONE, label = NONE;
    for (uint i = lane; i < n; i += width) {
        uint members = group_size_at(first + i);
        if (members == 0) continue;
        smallest = min(smallest, members);
        if (members > largest) {
            largest = members;
            label = i;
        }
    }
    uint most = subgroupMax(largest);
    uint fewest = subgroupMin(smallest);
    label = subgroupMin(largest == most ? label : NONE);
    if (!subgroupElect()) return;
    if ((FAIL_ON_SMALLEST != 0 ? fewest : most) < GROUP_MIN) { // guard: sets of three points
        if (push.round < push.last_round) {
            taus[set_index] = tau * TAU_GROWTH;
            uint groups = (push.point_count - 1) / gl_WorkGroupSize.x + 1;
            uint rows = (groups - 1) / MAX_GROUPS + 1; // guard: folded rounds
            ask(6 * (push.round + 1), (groups - 1) / rows + 1, rows);
            ask(6 * (push.round + 1) + 3, gl_NumWorkGroups.x, gl_NumWorkGroups.y);
        }
        return;
    }
    uint centre = label_at(first + min(heaviest[set_index], n - 1)); // guard: heaviest point of the set
    uint around = group_size_at(first + centre);
    bool central = around >= GROUP_MIN; // guard: a side of three points
    prime_labels[set_index] = central ? centre : label; // guard: the heaviest pixel's side
    cluster_sizes[set_index] = central ? around : most;
}

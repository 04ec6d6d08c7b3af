// Lanes of a subgroup see, in shared memory and in buffers, what the others wrote before.
//
// Lanes in lockstep need no control barrier for that, and on llvmpipe there must be none: from Mesa 24 on it takes a subgroup's
// control barrier for the workgroup's, and a subgroup that meets more of them than another ends there without notice.

// The driver runs a subgroup as one stream of masked vector instructions.
layout(constant_id = 7) const bool LOCKSTEP = false;

void subgroup_meets() {
    if (LOCKSTEP) subgroupMemoryBarrier();
    else subgroupBarrier();
}

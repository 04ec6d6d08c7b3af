// Makes earlier writes of a subgroup's lanes, to shared memory and to buffers, visible to its other lanes.
//
// Lanes in lockstep need no control barrier for that, and on llvmpipe there must be none. From Mesa 24 on
// llvmpipe takes a subgroup's control barrier for the workgroup's, and a subgroup that reaches more of them
// than another silently stops there.

// The driver runs a subgroup as one stream of masked vector instructions.
layout(constant_id = 7) const bool LOCKSTEP = false;

void subgroup_meets() {
    if (LOCKSTEP) subgroupMemoryBarrier();
    else subgroupBarrier();
}

// How scan and radix sort cut their input: a block of BLOCK consecutive items belongs to one subgroup, which walks it in
// rows of gl_SubgroupSize items, so no workgroup barrier is needed and no workgroup waits for another. BLOCK does not
// depend on the subgroup's size; hence neither do the results nor the buffers' sizes. Counts up to 2^26.
layout(constant_id = 1) const uint BLOCK = 1024;

uint blocks_for(uint items) {
    return (items + BLOCK - 1) / BLOCK;
}

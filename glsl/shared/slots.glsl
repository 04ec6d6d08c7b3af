// Whose splat an intersection's slot is. A splat's slots are contiguous, in order of rank, and every splat with a rank has one: so a bit
// for each slot at which a splat begins says it, and 8 bytes for 32 slots do what 4 bytes for each would.
const uint SLOTS_PER_BLOCK = 32;

// For the block of slots from 32 b on: the rank of slot 32 b, and where in the block, but not at its first slot, splats begin.
uint rank_of(uvec2 block, uint slot) {
    return block.x + bitCount(block.y & (2u << slot % SLOTS_PER_BLOCK) - 1u);
}

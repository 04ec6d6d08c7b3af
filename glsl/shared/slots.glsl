// Finds the splat that owns an intersection's slot. A splat's slots are contiguous, in order of rank, and
// every splat with a rank has one. So one bit for each slot, set if a splat begins there, is enough: 8 bytes
// for 32 slots instead of 4 bytes for each slot.
const uint SLOTS_PER_BLOCK = 32;

// Rank of the owner of `slot`. `block` covers 32 slots: x is the rank at its first slot, y has a bit for each
// later slot at which a splat begins.
uint rank_of(uvec2 block, uint slot) {
    return block.x + bitCount(block.y & (2u << slot % SLOTS_PER_BLOCK) - 1u);
}

// Where the gradient records of Gaussian i are: their first index and their number. Records by intersection are contiguous;
// where blend_backward_atomic has added them up there is one for each Gaussian.
// The kernel declares tile_counts and first_slot before.
uvec2 records_of(uint i, bool by_gaussian) {
    if (by_gaussian) return uvec2(i, 1);
    uint count = tile_counts[i];
    return uvec2(count == 0 ? 0 : first_slot[i], count);
}

// Sums of u32 that saturate at 2^32 - 1 instead of wrapping: a wrapped total would look small and pass a
// capacity check. min(a + b, 2^32 - 1) is associative, so the order of a scan does not change its result.
const uint SATURATED = 0xFFFFFFFFu;

uint saturating_add(uint a, uint b) {
    uint sum = a + b;
    return sum < a ? SATURATED : sum; // guard: sums that stop
}

// high * 2^16 + low, saturated. Both are sums of at most 64 halves, so neither can have wrapped.
uint saturating_join(uint high, uint low) {
    high += low >> 16;
    return high > 0xFFFFu ? SATURATED : (high << 16) | (low & 0xFFFFu); // guard: sums over lanes that stop
}

uint saturating_subgroup_add(uint value) {
    return saturating_join(subgroupAdd(value >> 16), subgroupAdd(value & 0xFFFFu));
}

uint saturating_subgroup_exclusive_add(uint value) {
    return saturating_join(subgroupExclusiveAdd(value >> 16), subgroupExclusiveAdd(value & 0xFFFFu));
}

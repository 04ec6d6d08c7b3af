// Sums over a contiguous range for each lane, in the same order on every device.
//
// The kernel defines SUMS, the number of sums, and `add(at, sums)`, which adds the item at index `at`. All
// lanes of a subgroup must call sum_over, which has subgroup operations.
const uint MANY = 256; // guard: sum of many slots by the whole subgroup
const uint UNROLL = 4; // guard: sum: several slots an iteration

void add(uint at, inout float sums[SUMS]);

// Sums `own.y` items from index `own.x` on. If there are more than MANY, the whole subgroup sums them, so
// that a Gaussian that fills the screen does not hold up others. It takes UNROLL at a time: llvmpipe ends a
// kernel's loops after 65,535 iterations of all its loops together, and 8 lanes that each fill an image of
// 3840 x 2160 (129,600 tiles of 8 x 8) need 32,400.
void sum_over(uvec2 own, out float sums[SUMS]) {
    [[unroll]] for (uint r = 0; r < SUMS; ++r) sums[r] = 0.0;
    if (own.y <= MANY) {
        for (uint at = own.x; at < own.x + own.y; ++at) add(at, sums);
    }
    for (uvec4 left = subgroupBallot(own.y > MANY); any(notEqual(left, uvec4(0)));) {
        uint lane = subgroupBallotFindLSB(left);
        left[lane / 32] &= ~(1u << (lane % 32));
        uint begin = subgroupShuffle(own.x, lane), end = begin + subgroupShuffle(own.y, lane);
        // Compensated (Kahan 1965): 16,200 equal terms drift by 2e-4 of their plain sum.
        precise float part[SUMS], lost[SUMS];
        [[unroll]] for (uint r = 0; r < SUMS; ++r) part[r] = lost[r] = 0.0;
        for (uint first = begin; first < end; first += UNROLL * gl_SubgroupSize) {
            float few[SUMS];
            [[unroll]] for (uint r = 0; r < SUMS; ++r) few[r] = 0.0;
            [[unroll]] for (uint k = 0; k < UNROLL; ++k) {
                uint at = first + k * gl_SubgroupSize + gl_SubgroupInvocationID;
                if (at < end) add(at, few);
            }
            [[unroll]] for (uint r = 0; r < SUMS; ++r) {
                precise float term = few[r] - lost[r];
                precise float sum = part[r] + term;
                lost[r] = (sum - part[r]) - term; // guard: compensated sum
                part[r] = sum;
            }
        }
        [[unroll]] for (uint r = 0; r < SUMS; ++r) {
            float total = subgroupAdd(part[r]);
            if (gl_SubgroupInvocationID == lane) sums[r] = total;
        }
    }
}

//! Sizes of scans and radix sorts, whose subgroups take blocks of items.

use super::constants::dispatch::GROUPS_PER_DIMENSION;
use crate::gpu::DeviceInfo;

/// Items that one subgroup takes. Large enough that a block's 256 digit counters are a quarter of what its keys and values
/// occupy, small enough that 10^5 items keep a GPU of 100 processors occupied.
pub const BLOCK: u32 = 1024;
/// Threads of a workgroup that takes blocks. Nothing is shared between its subgroups; 64 is the largest subgroup, and keeps
/// the digit counters of subgroups of 8 within 8 KiB of shared memory.
pub const WORKGROUP: u32 = 64;
/// Threads of the one workgroup that scans the sums of blocks: enough subgroups to hide the latency of reading 2^16 sums, few
/// where each costs CPU time.
pub const SPINE_WORKGROUP: u32 = 256;
/// Widest digit of a radix sort: 256 counters for each subgroup.
pub const MAX_DIGIT_BITS: u32 = 8;

/// Blocks of `items` items.
pub fn blocks_for(items: u32) -> u32 {
    items.div_ceil(BLOCK)
}

/// Items that one workgroup takes: what dispatches over blocks are made with.
pub fn items_per_group(device: &DeviceInfo) -> u32 {
    device.workgroup(WORKGROUP) / device.subgroup_size * BLOCK
}

/// Workgroups for so many items, as `groups_for` of `glsl/shared/dispatch.glsl`: at least one, folded into two dimensions.
pub fn groups_for(items: u32, per_group: u32) -> [u32; 3] {
    let groups = items.div_ceil(per_group.max(1)).max(1);
    let rows = groups.div_ceil(GROUPS_PER_DIMENSION);
    [groups.div_ceil(rows), rows, 1]
}

/// Elements of `block_sums` for at most `items` items: one for each block and the total.
pub fn block_sums_len(items: u32) -> usize {
    blocks_for(items) as usize + 1
}

/// Passes that sort keys below 2^`key_bits`, and the digit's width in each: the passes are as few and the digits as narrow
/// as can be.
pub fn passes_for(key_bits: u32) -> (u32, u32) {
    let passes = key_bits.clamp(1, 32).div_ceil(MAX_DIGIT_BITS);
    (passes, key_bits.clamp(1, 32).div_ceil(passes))
}

/// Elements of `block_counts` for at most `keys` keys: a counter of each digit for each block, of which there is at least
/// one.
pub fn block_counts_len(keys: u32, digit_bits: u32) -> usize {
    (blocks_for(keys).max(1) as usize) << digit_bits
}

/// Elements of `digit_totals`.
pub fn digit_totals_len(digit_bits: u32) -> usize {
    1 << digit_bits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_hold_what_the_kernels_write() {
        assert_eq!([0, 1, 1024, 1025, u32::MAX].map(blocks_for), [0, 1, 1, 2, 1 << 22]);
        assert_eq!([0, 1024, 1025].map(block_sums_len), [1, 2, 3]);
        assert_eq!([0, 1024, 1025].map(|keys| block_counts_len(keys, 8)), [256, 256, 512]);
        assert_eq!([1, 8].map(digit_totals_len), [2, 256]);
        let folded = [[1, 1, 1], [2, 1, 1], [32769, 2, 1]];
        assert_eq!([groups_for(0, 64), groups_for(65, 64), groups_for(65_537, 1)], folded);
    }

    #[test]
    fn passes_cover_the_bits_with_the_narrowest_digits() {
        let expected = [(1, 1), (1, 1), (1, 8), (2, 5), (2, 6), (2, 7), (4, 8), (4, 8)];
        assert_eq!([0, 1, 8, 9, 12, 13, 32, 99].map(passes_for), expected);
    }
}

//! Sizes of scans and radix sorts, whose subgroups take blocks of items.

use super::constants::dispatch::GROUPS_PER_DIMENSION;
use crate::gpu::DeviceInfo;

/// Block size of a scan or a radix sort on a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Blocks {
    /// Items that one subgroup takes.
    pub block: u32,
    /// Threads of a workgroup of such a kernel. Its subgroups share nothing.
    pub workgroup: u32,
    /// Widest digit of a radix sort, bits: a pass sorts by one digit.
    pub digit_bits: u32,
}

/// Blocks are large enough that their 256 digit counters are an eighth of the size of their keys and values,
/// and small enough that 10^5 items keep a GPU of 100 processors busy. A workgroup of 64 fits the largest
/// subgroup, and keeps the digit counters of subgroups of 8 within 8 KiB of shared memory.
const GPU: Blocks = Blocks { block: 1024, workgroup: 64, digit_bits: 8 };
/// A CPU has few processors, and pays for each item's reads and writes in every pass. So a digit covers the
/// tiles of an image of 256 × 256 in one pass, and blocks have the same ratio to their counters as on a GPU.
/// Depths, of 32 bits, take four passes all the same: three of 11 bits took as long. A workgroup of 16 fits
/// the largest subgroup of a CPU, and needs 8 KiB of counters with subgroups of 8.
const CPU: Blocks = Blocks { block: 4096, workgroup: 16, digit_bits: 10 };

impl Blocks {
    /// The sizes for a device.
    pub fn of(device: &DeviceInfo) -> Self {
        if device.constant_lanes().is_some() { CPU } else { GPU }
    }

    /// Number of passes that sort keys below 2^`key_bits`, and the digit's width in each: as few passes as
    /// possible, and then as narrow digits as possible.
    pub fn passes_for(&self, key_bits: u32) -> (u32, u32) {
        let passes = key_bits.clamp(1, 32).div_ceil(self.digit_bits);
        (passes, key_bits.clamp(1, 32).div_ceil(passes))
    }

    fn counters(&self, keys: u32, key_bits: u32) -> usize {
        (keys.div_ceil(self.block).max(1) as usize) << self.passes_for(key_bits).1
    }
}

/// Threads of the one workgroup that scans the sums of blocks: enough subgroups to hide the latency of
/// reading 2^16 sums, and few enough for a CPU, on which each costs time.
pub const SPINE_WORKGROUP: u32 = 256;

/// Items of one workgroup: the divisor of dispatches over blocks.
pub fn items_per_group(device: &DeviceInfo) -> u32 {
    let blocks = Blocks::of(device);
    device.workgroup(blocks.workgroup) / device.subgroup_size * blocks.block
}

/// Workgroups for `items`, like `groups_for` of `glsl/shared/dispatch.glsl`: at least one, folded into two
/// dimensions.
pub fn groups_for(items: u32, per_group: u32) -> [u32; 3] {
    let groups = items.div_ceil(per_group.max(1)).max(1);
    let rows = groups.div_ceil(GROUPS_PER_DIMENSION);
    [groups.div_ceil(rows), rows, 1]
}

/// Elements of `block_sums` for at most `items` items, on any device: one for each block and the total.
pub fn block_sums_len(items: u32) -> usize {
    items.div_ceil(GPU.block) as usize + 1
}

/// Elements of `block_counts` for at most `keys` keys below 2^`key_bits`, on any device: a counter of each
/// digit for each block, and at least one block.
pub fn block_counts_len(keys: u32, key_bits: u32) -> usize {
    GPU.counters(keys, key_bits).max(CPU.counters(keys, key_bits))
}

/// Elements of `digit_totals`, on any device.
pub const DIGIT_TOTALS: usize = 1 << CPU.digit_bits;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_hold_what_the_kernels_write() {
        assert_eq!([0, 1024, 1025].map(block_sums_len), [1, 2, 3]);
        // One pass of 8 bits; and one of 10, for which a GPU takes two of 5.
        assert_eq!([0, 1024, 1025].map(|keys| block_counts_len(keys, 8)), [256, 256, 512]);
        assert_eq!([0, 4096, 4097].map(|keys| block_counts_len(keys, 10)), [1024, 1024, 2048]);
        assert_eq!([0, 1 << 20].map(|keys| block_counts_len(keys, 32)), [256, 1 << 18]);
        let folded = [[1, 1, 1], [2, 1, 1], [32769, 2, 1]];
        assert_eq!([groups_for(0, 64), groups_for(65, 64), groups_for(65_537, 1)], folded);
    }

    #[test]
    fn passes_cover_the_bits_with_the_narrowest_digits() {
        let expected = [(1, 1), (1, 1), (1, 8), (2, 5), (2, 6), (2, 7), (4, 8), (4, 8)];
        assert_eq!([0, 1, 8, 9, 12, 13, 32, 99].map(|bits| GPU.passes_for(bits)), expected);
        assert_eq!([1, 10, 12, 32].map(|bits| CPU.passes_for(bits)), [(1, 1), (1, 10), (2, 6), (4, 8)]);
    }
}

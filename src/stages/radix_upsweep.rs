//! Counts the digits of each block: the first of the three kernels of a radix sort pass.

use super::scan_reduce::{BLOCK, WORKGROUP, blocks_for};
use crate::gpu::{Buffer, Context, GpuError, Pipeline, Recorder};

pub use super::kernels::radix_upsweep::{Buffers, Kernel, Push, Spec};

/// Widest digit: 256 counters for each subgroup.
pub const MAX_DIGIT_BITS: u32 = 8;

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

/// See `glsl/sort/radix_upsweep.comp`.
pub struct RadixUpsweep(Pipeline<Kernel>);

impl RadixUpsweep {
    /// `digit_bits` is 1 to [`MAX_DIGIT_BITS`]. With `compact`, keys of `0xFFFFFFFF` are left out.
    pub fn new(context: &Context, digit_bits: u32, compact: bool) -> Result<Self, GpuError> {
        let spec = Spec { workgroup_size: WORKGROUP, block: BLOCK, digit_bits, compact };
        Ok(RadixUpsweep(Pipeline::new(context, &spec)?))
    }

    /// The number of workgroups, for [`super::scan_reduce::items_per_group`], is at `slot` of `args`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push, args: &Buffer<u32>, slot: u32) {
        recorder.dispatch_indirect(&self.0, buffers, push, args, slot);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_cover_the_bits_with_the_narrowest_digits() {
        let expected = [(1, 1), (1, 1), (1, 8), (2, 5), (2, 6), (2, 7), (4, 8), (4, 8)];
        assert_eq!([0, 1, 8, 9, 12, 13, 32, 99].map(passes_for), expected);
    }

    #[test]
    fn sizes_hold_what_the_kernels_write() {
        assert_eq!([0, 1024, 1025].map(|keys| block_counts_len(keys, 8)), [256, 256, 512]);
        assert_eq!([1, 8].map(digit_totals_len), [2, 256]);
    }
}

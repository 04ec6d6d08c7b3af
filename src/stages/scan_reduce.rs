//! Sums the blocks of an exclusive prefix sum: the first of its three kernels.

use crate::gpu::{Buffer, Context, DeviceInfo, GpuError, Pipeline, Recorder};

pub use super::kernels::scan_reduce::{Buffers, Kernel, Push, Spec};

/// Items that one subgroup takes, in scans and radix sort passes. Large enough that a block's 256 digit counters are a
/// quarter of what its keys and values occupy, small enough that 10^5 items keep a GPU of 100 processors occupied.
pub const BLOCK: u32 = 1024;
/// Threads of a workgroup that takes blocks. Nothing is shared between its subgroups; 64 is the largest subgroup, and keeps
/// the digit counters of subgroups of 8 within 8 KiB of shared memory.
pub const WORKGROUP: u32 = 64;

/// Blocks of `items` items.
pub fn blocks_for(items: u32) -> u32 {
    items.div_ceil(BLOCK)
}

/// Items that one workgroup takes: what `dispatch_args` divides by for the scan and radix sort kernels.
pub fn items_per_group(device: &DeviceInfo) -> u32 {
    device.workgroup(WORKGROUP) / device.subgroup_size * BLOCK
}

/// Elements of `block_sums` for at most `items` items: one for each block and the total.
pub fn block_sums_len(items: u32) -> usize {
    blocks_for(items) as usize + 1
}

/// See `glsl/sort/scan_reduce.comp`.
pub struct ScanReduce(Pipeline<Kernel>);

impl ScanReduce {
    /// With `gather`, item i is `values[index[i]]`; without, `index` may be any buffer.
    pub fn new(context: &Context, gather: bool) -> Result<Self, GpuError> {
        let spec = Spec { workgroup_size: WORKGROUP, block: BLOCK, gather };
        Ok(ScanReduce(Pipeline::new(context, &spec)?))
    }

    /// The number of workgroups, for [`items_per_group`], is at `slot` of `args`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push, args: &Buffer<u32>, slot: u32) {
        recorder.dispatch_indirect(&self.0, buffers, push, args, slot);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_hold_what_the_kernels_write() {
        assert_eq!([0, 1, 1024, 1025, u32::MAX].map(blocks_for), [0, 1, 1, 2, 1 << 22]);
        assert_eq!([0, 1024, 1025].map(block_sums_len), [1, 2, 3]);
    }
}

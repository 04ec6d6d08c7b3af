//! Moves every pair to its place: the last of the three kernels of a radix sort pass.

use super::scan_reduce::{BLOCK, WORKGROUP};
use crate::gpu::{Buffer, Context, GpuError, Pipeline, Recorder};

pub use super::kernels::radix_downsweep::{Buffers, Kernel, Push, Spec};

/// See `glsl/sort/radix_downsweep.comp`.
pub struct RadixDownsweep(Pipeline<Kernel>);

impl RadixDownsweep {
    /// `digit_bits` as in the other kernels of the pass. With `compact`, keys of `0xFFFFFFFF` are dropped and a key's value
    /// is its index; `values_in` may then be any buffer.
    pub fn new(context: &Context, digit_bits: u32, compact: bool) -> Result<Self, GpuError> {
        let spec = Spec { workgroup_size: WORKGROUP, block: BLOCK, digit_bits, compact };
        Ok(RadixDownsweep(Pipeline::new(context, &spec)?))
    }

    /// The number of workgroups, for [`super::scan_reduce::items_per_group`], is at `slot` of `args`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push, args: &Buffer<u32>, slot: u32) {
        recorder.dispatch_indirect(&self.0, buffers, push, args, slot);
    }
}

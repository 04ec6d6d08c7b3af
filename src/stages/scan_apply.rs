//! Turns where the blocks begin into where each item does: the last kernel of an exclusive prefix sum.

use super::scan_reduce::{BLOCK, WORKGROUP};
use crate::gpu::{Buffer, Context, GpuError, Pipeline, Recorder};

pub use super::kernels::scan_apply::{Buffers, Kernel, Push, Spec};

/// See `glsl/sort/scan_apply.comp`.
pub struct ScanApply(Pipeline<Kernel>);

impl ScanApply {
    /// With `gather`, item i is `values[index[i]]`; without, `index` may be any buffer.
    pub fn new(context: &Context, gather: bool) -> Result<Self, GpuError> {
        let spec = Spec { workgroup_size: WORKGROUP, block: BLOCK, gather };
        Ok(ScanApply(Pipeline::new(context, &spec)?))
    }

    /// The number of workgroups, for [`super::scan_reduce::items_per_group`], is at `slot` of `args`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push, args: &Buffer<u32>, slot: u32) {
        recorder.dispatch_indirect(&self.0, buffers, push, args, slot);
    }
}

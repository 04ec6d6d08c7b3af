//! Turns the sums of blocks into where the blocks begin: the second kernel of an exclusive prefix sum.

use super::scan_reduce::BLOCK;
use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::scan_spine::{Buffers, Kernel, Push, Spec};

/// One workgroup does it all: enough subgroups to hide the latency of reading 2^16 sums, few where each costs CPU time.
const WORKGROUP: u32 = 256;

/// See `glsl/sort/scan_spine.comp`.
pub struct ScanSpine(Pipeline<Kernel>);

impl ScanSpine {
    pub fn new(context: &Context) -> Result<Self, GpuError> {
        let workgroup_size = WORKGROUP.min(context.info().max_workgroup);
        Ok(ScanSpine(Pipeline::new(context, &Spec { workgroup_size, block: BLOCK })?))
    }

    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, self.0.workgroup_size());
    }
}

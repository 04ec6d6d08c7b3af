//! Scans the digit counters over the blocks: the second of the three kernels of a radix sort pass.

use super::scan_reduce::BLOCK;
use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::radix_spine::{Buffers, Kernel, Push, Spec};

/// See `glsl/sort/radix_spine.comp`.
pub struct RadixSpine {
    pipeline: Pipeline<Kernel>,
    threads: u32,
}

impl RadixSpine {
    /// `digit_bits` as in the other kernels of the pass.
    pub fn new(context: &Context, digit_bits: u32) -> Result<Self, GpuError> {
        let lanes = context.info().subgroup_size;
        // A workgroup has a column of counters per lane, so they are few, and on a GPU it takes many subgroups in each to
        // hide the latency (1024 threads is what most GPUs allow). On a CPU each subgroup is only a cost.
        let most = context.info().max_workgroup.min(1024);
        let workgroup_size = if context.info().is_cpu { lanes } else { (lanes * 32).min(most) };
        let threads = (1u32 << digit_bits).div_ceil(lanes) * workgroup_size;
        let spec = Spec { workgroup_size, block: BLOCK, digit_bits };
        Ok(RadixSpine { pipeline: Pipeline::new(context, &spec)?, threads })
    }

    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.pipeline, buffers, push, self.threads);
    }
}

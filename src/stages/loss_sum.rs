//! Sums the tiles' sums into the losses of each frame.

use super::ssim_forward::SSIM_WEIGHT;
use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::loss_sum::{Buffers, Kernel, Push, Spec};

/// A frame of 1600 × 1064 pixels has 1700 tiles.
const WORKGROUP: u32 = 256;

/// See `glsl/loss/loss_sum.comp`.
pub struct LossSum(Pipeline<Kernel>);

impl LossSum {
    pub fn new(context: &Context) -> Result<Self, GpuError> {
        let workgroup_size = WORKGROUP.min(context.info().max_workgroup);
        Ok(LossSum(Pipeline::new(context, &Spec { workgroup_size, ssim_weight: SSIM_WEIGHT })?))
    }

    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.frame_count * self.0.workgroup_size());
    }
}

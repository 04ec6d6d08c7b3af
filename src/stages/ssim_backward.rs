//! Gradient of the L1 + SSIM loss by the rendered pixels.

use super::ssim_forward::{SSIM_WEIGHT, WORKGROUP};
use crate::gpu::{Buffer, Context, GpuError, Pipeline, Recorder};

pub use super::kernels::ssim_backward::{Buffers, Kernel, Push, Spec};

/// See `glsl/loss/ssim_backward.comp`.
pub struct SsimBackward(Pipeline<Kernel>);

impl SsimBackward {
    /// With `tile_list`, only listed tiles are done; without, `count` and `tile_list` may be any buffers.
    pub fn new(context: &Context, tile_list: bool) -> Result<Self, GpuError> {
        let spec = Spec { workgroup_size: WORKGROUP, tile_list, ssim_weight: SSIM_WEIGHT };
        Ok(SsimBackward(Pipeline::new(context, &spec)?))
    }

    /// All tiles of all frames.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.tile_count * WORKGROUP);
    }

    /// The listed tiles: one workgroup for each, their number at `slot` of `args`.
    pub fn record_list(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers<'_>,
        push: &Push,
        args: &Buffer<u32>,
        slot: u32,
    ) {
        recorder.dispatch_indirect(&self.0, buffers, push, args, slot);
    }
}

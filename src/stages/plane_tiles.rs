//! Lists the tiles of the loss that matter to the 2D Gaussians.

use super::ssim_forward::TILE;
use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::plane_tiles::{Buffers, Kernel, Push, Spec};

/// See `glsl/plane/plane_tiles.comp`.
pub struct PlaneTiles(Pipeline<Kernel>);

impl PlaneTiles {
    pub fn new(context: &Context, workgroup_size: u32) -> Result<Self, GpuError> {
        Ok(PlaneTiles(Pipeline::new(context, &Spec { workgroup_size, tile: TILE })?))
    }

    /// Clears the marks and counts first. One thread for each slot.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.fill(buffers.tile_marks, 0);
        recorder.fill(buffers.count, 0);
        recorder.dispatch(&self.0, buffers, push, push.slots);
    }
}

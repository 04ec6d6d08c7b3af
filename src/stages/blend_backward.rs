//! Gradients of the blended image, one record for each intersection.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::blend_backward::{Buffers, Kernel, Push, Spec};

/// See `glsl/raster/blend_backward.comp`.
pub struct BlendBackward(Pipeline<Kernel>);

impl BlendBackward {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(BlendBackward(Pipeline::new(context, spec)?))
    }

    /// One subgroup for each tile.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        let lanes = recorder.context().info().subgroup_size;
        recorder.dispatch(&self.0, buffers, push, push.tile_count * lanes);
    }
}

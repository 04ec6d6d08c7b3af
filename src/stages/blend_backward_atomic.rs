//! Gradients of the blended image, one record for each Gaussian, added up by float atomics.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::blend_backward_atomic::{Buffers, Kernel, Push, Spec};

/// See `glsl/raster/blend_backward_atomic.comp`. The device must have [`crate::gpu::DeviceInfo::float_atomics`].
pub struct BlendBackwardAtomic(Pipeline<Kernel>);

impl BlendBackwardAtomic {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(BlendBackwardAtomic(Pipeline::new(context, spec)?))
    }

    /// One subgroup for each tile.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        let lanes = recorder.context().info().subgroup_size;
        recorder.dispatch(&self.0, buffers, push, push.tile_count * lanes);
    }
}

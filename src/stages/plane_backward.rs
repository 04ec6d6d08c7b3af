//! From intersection records to gradients of 2D Gaussians, and the Adam step on them.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::plane_backward::{Buffers, Kernel, Push, Spec};

/// See `glsl/plane/plane_backward.comp`.
pub struct PlaneBackward(Pipeline<Kernel>);

impl PlaneBackward {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(PlaneBackward(Pipeline::new(context, spec)?))
    }

    /// One thread for each slot.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.count);
    }
}

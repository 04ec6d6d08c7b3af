//! Makes splats of the 2D Gaussians of a batch of views.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::plane_project::{Buffers, Kernel, Push, Spec};

/// See `glsl/plane/plane_project.comp`.
pub struct PlaneProject(Pipeline<Kernel>);

impl PlaneProject {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(PlaneProject(Pipeline::new(context, spec)?))
    }

    /// One thread for each slot.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.count);
    }
}

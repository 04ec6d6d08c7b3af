//! From intersection records to gradients, and the Adam step on them.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::project_backward::{Buffers, Kernel, Push, Spec};

/// See `glsl/optim/project_backward.comp`.
pub struct ProjectBackward(Pipeline<Kernel>);

impl ProjectBackward {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(ProjectBackward(Pipeline::new(context, spec)?))
    }

    /// One thread for each Gaussian of the range.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.count);
    }
}

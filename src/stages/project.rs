//! Projects Gaussians into one view.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::project::{Buffers, Kernel, Push, Spec};

/// See `glsl/raster/project.comp`.
pub struct Project(Pipeline<Kernel>);

impl Project {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(Project(Pipeline::new(context, spec)?))
    }

    /// One thread for each Gaussian.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.count);
    }
}

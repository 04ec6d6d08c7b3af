//! Writes lifts behind the Gaussians that there are.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::lift_append::{Buffers, Kernel, Push, Spec};

/// See `glsl/lift/lift_append.comp`.
pub struct LiftAppend(Pipeline<Kernel>);

impl LiftAppend {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(LiftAppend(Pipeline::new(context, spec)?))
    }

    /// `lift_ranks` is the exclusive scan of `lift_flags`. One thread for each 2D Gaussian.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.count);
    }
}

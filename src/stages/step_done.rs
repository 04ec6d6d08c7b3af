//! Counts a training step, unless the step was left out because a buffer was too small.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

use super::kernels::constants::status;
pub use super::kernels::step_done::{Buffers, Kernel, Push, Spec};

/// Word of `status`: 0, or the number of intersections that a view needed when it was more than the buffers hold.
pub const OVERFLOW: usize = status::STATUS_OVERFLOW as usize;
/// Word of `status`: training steps completed.
pub const STEPS: usize = status::STATUS_STEPS as usize;
/// Words of `status`.
pub const STATUS_WORDS: usize = STEPS + 1;

/// See `glsl/optim/step_done.comp`.
pub struct StepDone(Pipeline<Kernel>);

impl StepDone {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(StepDone(Pipeline::new(context, spec)?))
    }

    /// One thread.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>) {
        recorder.dispatch(&self.0, buffers, &Push {}, 1);
    }
}

//! Counts the pixels with a depth that each 2D Gaussian covers.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::lift_count::{Buffers, Kernel, Push, Spec};

/// See `glsl/lift/lift_count.comp`.
pub struct LiftCount(Pipeline<Kernel>);

impl LiftCount {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(LiftCount(Pipeline::new(context, spec)?))
    }

    /// `point_counts` has `count` elements. One subgroup for each 2D Gaussian.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        let lanes = recorder.context().info().subgroup_size;
        recorder.dispatch(&self.0, buffers, push, push.count * lanes);
    }
}

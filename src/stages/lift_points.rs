//! Unprojects the pixels that each 2D Gaussian covers.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::lift_points::{Buffers, Kernel, Push, Spec};

/// See `glsl/lift/lift_points.comp`.
pub struct LiftPoints(Pipeline<Kernel>);

impl LiftPoints {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(LiftPoints(Pipeline::new(context, spec)?))
    }

    /// `point_firsts` is the exclusive scan of `point_counts`, `points`, `point_sets` and `labels` have room for their
    /// sum; `heaviest` and `taus` have `count` elements. One subgroup for each 2D Gaussian.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        let lanes = recorder.context().info().subgroup_size;
        recorder.dispatch(&self.0, buffers, push, push.count * lanes);
    }
}

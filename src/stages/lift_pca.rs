//! Makes a 3D Gaussian of each prime group.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::lift_pca::{Buffers, Kernel, Push, Spec};

/// See `glsl/lift/lift_pca.comp`.
pub struct LiftPca(Pipeline<Kernel>);

impl LiftPca {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(LiftPca(Pipeline::new(context, spec)?))
    }

    /// `lifts` and `lift_flags` have `count` elements. One subgroup for each 2D Gaussian.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        let lanes = recorder.context().info().subgroup_size;
        recorder.dispatch(&self.0, buffers, push, push.count * lanes);
    }
}

//! Empties the slots of 2D Gaussians that are nearly transparent or cover too few pixels.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::plane_prune::{Buffers, Kernel, Push, Spec};

/// See `glsl/plane/plane_prune.comp`.
pub struct PlanePrune(Pipeline<Kernel>);

impl PlanePrune {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(PlanePrune(Pipeline::new(context, spec)?))
    }

    /// One subgroup for each slot.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        let lanes = recorder.context().info().subgroup_size;
        recorder.dispatch(&self.0, buffers, push, push.count * lanes);
    }
}

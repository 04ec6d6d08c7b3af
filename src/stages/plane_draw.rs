//! Draws pixels of each view where its loss is high, and puts a new 2D Gaussian on each.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::plane_draw::{Buffers, Kernel, Push, Spec};

/// See `glsl/plane/plane_draw.comp`.
pub struct PlaneDraw(Pipeline<Kernel>);

impl PlaneDraw {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        let workgroup_size = spec.workgroup_size.min(context.info().max_workgroup);
        Ok(PlaneDraw(Pipeline::new(context, &Spec { workgroup_size })?))
    }

    /// One workgroup for each view of the batch.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.frame_count * self.0.workgroup_size());
    }
}

//! Judges the components of each set, names its prime group and asks for another round where there is none.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::lift_groups::{Buffers, Kernel, Push, Spec};

/// See `glsl/lift/lift_groups.comp`.
pub struct LiftGroups(Pipeline<Kernel>);

impl LiftGroups {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(LiftGroups(Pipeline::new(context, spec)?))
    }

    /// Round 0 for all sets, one subgroup for each; a later round if its slot of `rounds` asks for it.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        if push.round == 0 {
            let lanes = recorder.context().info().subgroup_size;
            recorder.dispatch(&self.0, buffers, push, push.count * lanes);
        } else {
            recorder.dispatch_indirect(&self.0, buffers, push, buffers.rounds, 2 * push.round + 1);
        }
    }
}

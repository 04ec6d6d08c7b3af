//! Joins the points of each set that are closer than its τ.

use crate::gpu::{Buffer, Context, GpuError, Pipeline, Recorder};

pub use super::kernels::lift_join::{Buffers, Kernel, Push, Spec};

/// See `glsl/lift/lift_join.comp`.
pub struct LiftJoin(Pipeline<Kernel>);

impl LiftJoin {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(LiftJoin(Pipeline::new(context, spec)?))
    }

    /// One lane for each point of all sets.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.point_count);
    }

    /// The same, if slot `slot` of `rounds` asks for it.
    pub fn record_indirect(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers<'_>,
        push: &Push,
        rounds: &Buffer<u32>,
        slot: u32,
    ) {
        recorder.dispatch_indirect(&self.0, buffers, push, rounds, slot);
    }
}

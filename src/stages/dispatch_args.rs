//! Turns a count on the GPU into an indirect dispatch, and keeps it within what the buffers hold.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::dispatch_args::{Buffers, Kernel, Push, Spec};

/// See `glsl/sort/dispatch_args.comp`.
pub struct DispatchArgs(Pipeline<Kernel>);

impl DispatchArgs {
    pub fn new(context: &Context) -> Result<Self, GpuError> {
        // One thread works; more would only idle.
        Ok(DispatchArgs(Pipeline::new(context, &Spec { workgroup_size: 1 })?))
    }

    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, 1);
    }
}

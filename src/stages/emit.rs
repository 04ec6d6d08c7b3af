//! Lists the tiles of every visible splat, splats in depth order.

use crate::gpu::{Buffer, Context, GpuError, Pipeline, Recorder};

pub use super::kernels::emit::{Buffers, Kernel, Push, Spec};

/// See `glsl/raster/emit.comp`.
pub struct Emit(Pipeline<Kernel>);

impl Emit {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(Emit(Pipeline::new(context, spec)?))
    }

    /// One thread for each visible splat; the number of workgroups is at `slot` of `args`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push, args: &Buffer<u32>, slot: u32) {
        recorder.dispatch_indirect(&self.0, buffers, push, args, slot);
    }
}

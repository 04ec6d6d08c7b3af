//! Multiply-adds and nothing else: the rate that the floors of the other stages are computed from.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::fma_rate::{Buffers, Kernel, Push, Spec};

/// See `glsl/verify/fma_rate.comp`.
pub struct FmaRate(Pipeline<Kernel>);

impl FmaRate {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(FmaRate(Pipeline::new(context, spec)?))
    }

    /// One thread for each sum.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.count);
    }
}

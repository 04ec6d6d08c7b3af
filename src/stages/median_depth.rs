//! Depth of each pixel from the Gaussian of median transmittance.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::median_depth::{Buffers, Kernel, Push, Spec};

/// See `glsl/raster/median_depth.comp`.
pub struct MedianDepth(Pipeline<Kernel>);

impl MedianDepth {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(MedianDepth(Pipeline::new(context, spec)?))
    }

    /// One thread for each of the view's `pixels`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push, pixels: u32) {
        recorder.dispatch(&self.0, buffers, push, pixels);
    }
}

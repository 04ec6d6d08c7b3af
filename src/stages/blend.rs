//! Blends each tile's splats front to back into colour and transmittance.

use crate::gpu::{Context, GpuError, Pipeline, Recorder};

pub use super::kernels::blend::{Buffers, Kernel, Push, Spec};

/// See `glsl/raster/blend.comp`.
pub struct Blend(Pipeline<Kernel>);

impl Blend {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(Blend(Pipeline::new(context, spec)?))
    }

    /// One subgroup for each tile.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        let lanes = recorder.context().info().subgroup_size;
        recorder.dispatch(&self.0, buffers, push, push.tile_count * lanes);
    }
}

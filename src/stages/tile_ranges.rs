//! Finds where each tile's intersections begin and end in the sorted list.

use crate::gpu::{Buffer, Context, GpuError, Pipeline, Recorder};

pub use super::kernels::tile_ranges::{Buffers, Kernel, Push, Spec};

/// See `glsl/raster/tile_ranges.comp`.
pub struct TileRanges(Pipeline<Kernel>);

impl TileRanges {
    pub fn new(context: &Context, spec: &Spec) -> Result<Self, GpuError> {
        Ok(TileRanges(Pipeline::new(context, spec)?))
    }

    /// Clears the ranges first. One thread for each intersection; the number of workgroups is at `slot` of `args`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push, args: &Buffer<u32>, slot: u32) {
        recorder.fill(buffers.tile_ranges, 0);
        recorder.dispatch_indirect(&self.0, buffers, push, args, slot);
    }
}

//! SSIM and L1 of rendered frames against their targets, with the partial derivatives that `ssim_backward` needs.

use super::types::Frame;
use crate::gpu::{Buffer, Context, GpuError, Pipeline, Recorder};

pub use super::kernels::ssim_forward::{Buffers, Kernel, Push, Spec};

/// Weight of 1 − SSIM in the loss; |x − y| has the rest (Kerbl et al. 2023).
pub const SSIM_WEIGHT: f32 = 0.2;
pub use super::kernels::constants::ssim::{TILE, WORKGROUP};

/// Tiles of a frame. Tile t is column t mod ⌈width / [`TILE`]⌉; its number among all is frame × tiles_per_frame + t.
pub fn tiles_for(frame: &Frame) -> u32 {
    frame.width.div_ceil(TILE) * frame.height.div_ceil(TILE)
}

/// The most tiles of any of the frames: what each is given in `partials` and `tile_sums`.
pub fn tiles_per_frame(frames: &[Frame]) -> u32 {
    frames.iter().map(tiles_for).max().unwrap_or(0)
}

/// Elements of `partials`: three for each channel of each pixel of the tiles.
pub fn partials_len(frames: u32, tiles_per_frame: u32) -> usize {
    frames as usize * tiles_per_frame as usize * (9 * TILE * TILE) as usize
}

/// Elements of `tile_sums`.
pub fn tile_sums_len(frames: u32, tiles_per_frame: u32) -> usize {
    frames as usize * tiles_per_frame as usize
}

/// See `glsl/loss/ssim_forward.comp`.
pub struct SsimForward(Pipeline<Kernel>);

impl SsimForward {
    /// With `tile_list`, only listed tiles are done; without, `count` and `tile_list` may be any buffers. With `loss_map` the
    /// loss of each pixel is written too; without, `loss_map` may be any buffer.
    pub fn new(context: &Context, tile_list: bool, loss_map: bool) -> Result<Self, GpuError> {
        let spec = Spec { workgroup_size: WORKGROUP, tile_list, ssim_weight: SSIM_WEIGHT, loss_map };
        Ok(SsimForward(Pipeline::new(context, &spec)?))
    }

    /// All tiles of all frames.
    pub fn record(&self, recorder: &mut Recorder, buffers: &Buffers<'_>, push: &Push) {
        recorder.dispatch(&self.0, buffers, push, push.tile_count * WORKGROUP);
    }

    /// The listed tiles: one workgroup for each, their number at `slot` of `args`.
    pub fn record_list(
        &self,
        recorder: &mut Recorder,
        buffers: &Buffers<'_>,
        push: &Push,
        args: &Buffer<u32>,
        slot: u32,
    ) {
        recorder.dispatch_indirect(&self.0, buffers, push, args, slot);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_hold_what_the_kernels_write() {
        let frame = |width, height| Frame { width, height, ..Default::default() };
        assert_eq!([(1, 1), (32, 32), (33, 32), (64, 48)].map(|(w, h)| tiles_for(&frame(w, h))), [1, 1, 2, 4]);
        assert_eq!(tiles_per_frame(&[frame(17, 3), frame(64, 48)]), 4);
        assert_eq!((partials_len(2, 4), tile_sums_len(2, 4)), (2 * 4 * 9216, 8));
    }
}

//! The photometric loss of rendered frames and its gradient: 0.8·L1 + 0.2·(1 − SSIM).

use super::raster::Raster;
use crate::{
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    stages::{
        loss_sum::{self, LossSum},
        ssim_backward::{self, SsimBackward},
        ssim_forward::{self, SsimForward, partials_len, tile_sums_len},
        types::{Frame, Loss},
    },
};

/// Pipelines and working buffers for batches of up to a number of frames.
pub struct Photometric {
    forward: SsimForward,
    backward: SsimBackward,
    sum: LossSum,
    tiles_per_frame: u32,
    partials: Buffer<f32>,
    tile_sums: Buffer<[f32; 2]>,
    /// By step and frame. In host memory: 12 bytes are written for each frame of each step.
    pub losses: Buffer<Loss>,
}

impl Photometric {
    /// For `frame_count` frames at a time, `tiles_per_frame` the most of any ([`ssim_forward::tiles_per_frame`]), and
    /// `losses` losses remembered.
    pub fn new(context: &Context, frame_count: u32, tiles_per_frame: u32, losses: usize) -> Result<Self, GpuError> {
        Ok(Photometric {
            forward: SsimForward::new(context, false, false)?,
            backward: SsimBackward::new(context, false)?,
            sum: LossSum::new(context)?,
            tiles_per_frame,
            partials: Buffer::new(context, "partials", partials_len(frame_count, tiles_per_frame), Location::Device)?,
            tile_sums: Buffer::new(
                context,
                "tile sums",
                tile_sums_len(frame_count, tiles_per_frame),
                Location::Device,
            )?,
            losses: Buffer::new(context, "losses", losses, Location::Readback)?,
        })
    }

    /// Compares the raster's image of frames `frame_first..+frame_count` with their targets: `image_grad` of the raster, and
    /// the losses at `slot` and on.
    pub fn record(
        &self,
        recorder: &mut Recorder,
        raster: &Raster,
        frames: &Buffer<Frame>,
        targets: &Buffer<u32>,
        (frame_first, frame_count): (u32, u32),
        slot: u32,
    ) {
        let tiles_per_frame = self.tiles_per_frame;
        let tile_count = tiles_per_frame * frame_count;
        // Without tile list and loss map their bindings are not read or written: any buffers will do.
        self.forward.record(
            recorder,
            &ssim_forward::Buffers {
                count: targets,
                tile_list: targets,
                frames,
                image: &raster.image,
                targets,
                partials: &self.partials,
                tile_sums: &self.tile_sums,
                loss_map: &raster.image_grad,
            },
            &ssim_forward::Push { frame_first, tiles_per_frame, tile_count, count_index: 0 },
        );
        self.backward.record(
            recorder,
            &ssim_backward::Buffers {
                count: targets,
                tile_list: targets,
                frames,
                image: &raster.image,
                targets,
                partials: &self.partials,
                image_grad: &raster.image_grad,
            },
            &ssim_backward::Push { frame_first, tiles_per_frame, tile_count, count_index: 0 },
        );
        self.sum.record(
            recorder,
            &loss_sum::Buffers { frames, tile_sums: &self.tile_sums, losses: &self.losses },
            &loss_sum::Push { frame_first, frame_count, tiles_per_frame, slot },
        );
    }
}

//! The photometric loss of rendered frames and its gradient: 0.8·L1 + 0.2·(1 − SSIM).

use super::plan::{Plan, buffers};
use crate::{
    gpu::{Buffer, Context, GpuError, Location, Recorder, Unused},
    stages::{
        loss_probe, loss_sum,
        ssim::{SSIM_WEIGHT, SUM_WORKGROUP, WORKGROUP, partials_len, run_and_strip_for},
        ssim_backward, ssim_forward,
        types::{Frame, Loss},
    },
};

/// Selection of the tiles that a loss covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tiles {
    /// Every tile of every frame of the batch.
    All,
    /// All tiles, and also write the loss of each pixel.
    Map,
    /// The tiles of [`TileLists`].
    Listed,
}

/// Options and sizes of a [`Photometric`].
#[derive(Debug, Clone, Copy, Default)]
pub struct LossOptions {
    /// Tiles of the largest batch; each frame counts as its largest.
    pub tiles: u32,
    /// Pixels of the largest batch, for [`Tiles::Map`].
    pub map_pixels: u32,
    /// Number of losses stored.
    pub losses: u32,
    /// Enable [`Tiles::Listed`].
    pub listed: bool,
    /// Enable gradients.
    pub backward: bool,
    /// Enable [`Photometric::record_probe`].
    pub probe: bool,
}

/// The frames of a batch with their rendered images and targets.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    /// Layout of the frames' pixels.
    pub frames: &'a Buffer<Frame>,
    /// Index in `frames` of the first frame.
    pub frame_first: u32,
    /// Frames, one after the other.
    pub frame_count: u32,
    /// Maximum over the frames, see [`tiles_per_frame`](crate::stages::ssim::tiles_per_frame).
    pub tiles_per_frame: u32,
    /// The rendered image: sRGB and transmittance per pixel.
    pub image: &'a Buffer<[f32; 4]>,
    /// Photographs: packed 8-bit RGBA per pixel, alpha 0 if the pixel is masked out.
    pub targets: &'a Buffer<u32>,
}

buffers! {
    struct LossBuffers(o: LossOptions) {
        partials: [f32; 3] = partials_len(o.tiles),
        tile_sums: [f32; 3] = o.tiles,
        loss_map: f32 = o.map_pixels,
    }
}

buffers! {
    /// Lists of tiles that can have changed: one for the forward pass and one for the gradient.
    pub struct TileLists(tiles: u32) {
        /// Marks tiles that are in a list already, for both lists.
        pub tile_marks: u32 = 2 * *tiles,
        /// Number of tiles in each list.
        pub count: u32 = 2,
        /// Dispatches with one workgroup per listed tile.
        pub args: u32 = 6,
        /// Tiles of the forward pass, in any order.
        pub forward_tiles: u32 = *tiles,
        /// Tiles of the gradient, in any order.
        pub backward_tiles: u32 = *tiles,
    }
}

/// Pipelines and working buffers for batches of up to a number of frames.
pub struct Photometric {
    buffers: LossBuffers,
    /// Losses by step or by frame. In host memory: each step writes 16 bytes per frame.
    pub losses: Buffer<Loss>,
    /// Variants for [`Tiles::All`], [`Tiles::Map`] and [`Tiles::Listed`].
    forward: [Option<ssim_forward::Stage>; 3],
    backward: [Option<ssim_backward::Stage>; 3],
    sum: loss_sum::Stage,
    probe: Option<loss_probe::Stage>,
    unused: Unused,
}

impl Photometric {
    /// Makes the pipelines and buffers of the loss.
    pub fn new(context: &Context, options: &LossOptions) -> Result<Self, GpuError> {
        let (workgroup_size, ssim_weight) = (WORKGROUP, SSIM_WEIGHT);
        let [run, strip] = run_and_strip_for(context.info());
        let forward = |wanted, tile_list, loss_map| {
            let spec = ssim_forward::Spec { workgroup_size, tile_list, ssim_weight, loss_map, run, strip };
            if wanted { ssim_forward::Stage::new(context, &spec).map(Some) } else { Ok(None) }
        };
        let backward = |wanted, tile_list| {
            let spec = ssim_backward::Spec { workgroup_size, tile_list, ssim_weight, run, strip };
            if wanted { ssim_backward::Stage::new(context, &spec).map(Some) } else { Ok(None) }
        };
        let probe = |wanted| {
            let spec = loss_probe::Spec { workgroup_size: crate::stages::WORKGROUP, ssim_weight };
            if wanted { loss_probe::Stage::new(context, &spec).map(Some) } else { Ok(None) }
        };
        let sum_spec = loss_sum::Spec { workgroup_size: SUM_WORKGROUP.min(context.info().max_workgroup), ssim_weight };
        Ok(Photometric {
            forward: [
                forward(true, false, false)?,
                forward(options.map_pixels > 0, false, true)?,
                forward(options.listed, true, false)?,
            ],
            backward: [backward(options.backward, false)?, None, backward(options.backward && options.listed, true)?],
            sum: loss_sum::Stage::new(context, &sum_spec)?,
            probe: probe(options.probe)?,
            buffers: LossBuffers::new(context, options)?,
            losses: Buffer::new(context, "losses", options.losses as usize, Location::Host)?,
            unused: Unused::new(context)?,
        })
    }

    /// Makes room for `count` losses; those stored so far may be lost.
    pub fn make_room(&mut self, context: &Context, count: usize) -> Result<(), GpuError> {
        if self.losses.len() < count {
            self.losses = Buffer::new(context, "losses", count, Location::Host)?;
        }
        Ok(())
    }

    /// The buffers of a loss with these options.
    pub fn plan(options: &LossOptions) -> Plan {
        LossBuffers::plan(options)
    }

    /// Loss by pixel of the batch, after [`Tiles::Map`] was recorded.
    pub fn loss_map(&self) -> &Buffer<f32> {
        &self.buffers.loss_map
    }

    /// Compares the batch's images with their targets. `lists` is required for [`Tiles::Listed`].
    pub fn record_forward(&self, recorder: &mut Recorder, batch: &Batch<'_>, tiles: Tiles, lists: Option<&TileLists>) {
        let Some(stage) = &self.forward[tiles as usize] else { return };
        let (words, map) = (self.unused.of(), self.unused.of());
        let buffers = ssim_forward::Buffers {
            count: lists.map_or(&words, |l| &l.count),
            tile_list: lists.map_or(&words, |l| &l.forward_tiles),
            frames: batch.frames,
            image: batch.image,
            targets: batch.targets,
            partials: &self.buffers.partials,
            tile_sums: &self.buffers.tile_sums,
            loss_map: if tiles == Tiles::Map { &self.buffers.loss_map } else { &map },
        };
        let (frame_first, tiles_per_frame) = (batch.frame_first, batch.tiles_per_frame);
        let tile_count = tiles_per_frame * batch.frame_count;
        let push = ssim_forward::Push { frame_first, tiles_per_frame, tile_count, count_index: 0 };
        match lists.filter(|_| tiles == Tiles::Listed) {
            Some(lists) => stage.record_indirect(recorder, &buffers, &push, &lists.args, 0),
            None => stage.record(recorder, &buffers, &push, tile_count),
        }
    }

    /// Gradient of the loss of [`Photometric::record_forward`] by the images' pixels.
    pub fn record_backward(
        &self,
        recorder: &mut Recorder,
        batch: &Batch<'_>,
        image_grad: &Buffer<f32>,
        tiles: Tiles,
        lists: Option<&TileLists>,
    ) {
        let Some(stage) = &self.backward[tiles as usize] else { return };
        let words = self.unused.of();
        let buffers = ssim_backward::Buffers {
            count: lists.map_or(&words, |l| &l.count),
            tile_list: lists.map_or(&words, |l| &l.backward_tiles),
            frames: batch.frames,
            image: batch.image,
            targets: batch.targets,
            partials: &self.buffers.partials,
            image_grad,
        };
        let (frame_first, tiles_per_frame) = (batch.frame_first, batch.tiles_per_frame);
        let tile_count = tiles_per_frame * batch.frame_count;
        let push = ssim_backward::Push { frame_first, tiles_per_frame, tile_count, count_index: 1 };
        match lists.filter(|_| tiles == Tiles::Listed) {
            Some(lists) => stage.record_indirect(recorder, &buffers, &push, &lists.args, 1),
            None => stage.record(recorder, &buffers, &push, tile_count),
        }
    }

    /// Replaces the gradient of the batch's only frame by a random one, drawn in each step.
    /// [`Learner::record_probe`](super::learn::Learner::record_probe) estimates the curvature from it.
    pub fn record_probe(
        &self,
        recorder: &mut Recorder,
        batch: &Batch<'_>,
        image_grad: &Buffer<f32>,
        pixels: u32,
        step: u32,
    ) {
        let Some(stage) = &self.probe else { return };
        let Batch { frames, frame_first: frame, image, targets, .. } = *batch;
        let buffers = loss_probe::Buffers { frames, image, targets, image_grad };
        stage.record(recorder, &buffers, &loss_probe::Push { frame, step }, pixels);
    }

    /// Sums the tiles of each frame into [`Photometric::losses`], from index `first` on.
    pub fn record_sum(&self, recorder: &mut Recorder, batch: &Batch<'_>, first: u32) {
        let Batch { frames, frame_first, frame_count, tiles_per_frame, .. } = *batch;
        self.sum.record(
            recorder,
            &loss_sum::Buffers { frames, tile_sums: &self.buffers.tile_sums, losses: &self.losses },
            &loss_sum::Push { frame_first, frame_count, tiles_per_frame, first },
            frame_count,
        );
    }
}

//! Views in batches that the device holds at once, and the loss of a batch's images.

use std::ops::Range;

use crate::{
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    scene::Camera,
    stages::{
        loss_sum::{self, LossSum},
        ssim_backward::{self, SsimBackward},
        ssim_forward::{self, SsimForward},
        types::{Frame, Loss},
    },
};

/// Pixels of a batch. A pixel needs 88 bytes of working memory, so this is 1.5 GB; 26 views of 800 × 800.
const BATCH_PIXELS: u64 = 1 << 24;

/// Splits views into batches that the device holds at once: consecutive ones, at least one each.
pub fn batches(context: &Context, cameras: &[Camera]) -> Vec<Range<usize>> {
    // The largest buffer of a batch has 9 floats for each pixel, of whole tiles of the largest view.
    let tile = u64::from(ssim_forward::TILE);
    let limit = BATCH_PIXELS.min(context.info().max_storage_bytes / 36);
    let mut list = Vec::new();
    let (mut first, mut largest) = (0, 0u64);
    for (v, camera) in cameras.iter().enumerate() {
        let tiles = u64::from(camera.width).div_ceil(tile) * u64::from(camera.height).div_ceil(tile);
        let padded = largest.max(tiles * tile * tile);
        if v > first && (v + 1 - first) as u64 * padded > limit {
            list.push(first..v);
            first = v;
            largest = tiles * tile * tile;
        } else {
            largest = padded;
        }
    }
    if first < cameras.len() {
        list.push(first..cameras.len());
    }
    list
}

/// The frames of a batch: images packed one after the other, targets where the dataset has them.
pub(super) fn frames_of(cameras: &[Camera], batch: &Range<usize>) -> Vec<Frame> {
    let mut target_first: u32 = cameras[..batch.start].iter().map(Camera::pixels).sum();
    let mut image_first = 0;
    let mut frames = Vec::with_capacity(batch.len());
    for camera in &cameras[batch.clone()] {
        frames.push(Frame { image_first, target_first, width: camera.width, height: camera.height });
        image_first += camera.pixels();
        target_first += camera.pixels();
    }
    frames
}

/// What the loss of a batch needs.
pub(super) struct LossBuffers {
    pub partials: Buffer<f32>,
    pub tile_sums: Buffer<[f32; 2]>,
    pub loss_map: Buffer<f32>,
    /// By position in the batch.
    pub losses: Buffer<Loss>,
}

/// The largest numbers of all batches.
pub(super) struct Sizes {
    pub frames: usize,
    pub pixels: u32,
    pub width: u32,
    pub height: u32,
    /// Loss tiles of a frame, and of a batch with each frame having as many as its largest.
    pub loss_tiles: usize,
}

impl Sizes {
    pub fn of(cameras: &[Camera], batches: &[Range<usize>]) -> Self {
        let mut sizes = Sizes { frames: 0, pixels: 0, width: 0, height: 0, loss_tiles: 0 };
        for batch in batches {
            let frames = frames_of(cameras, batch);
            let tiles = ssim_forward::tile_sums_len(frames.len() as u32, ssim_forward::tiles_per_frame(&frames));
            sizes.frames = sizes.frames.max(frames.len());
            sizes.pixels = sizes.pixels.max(frames.iter().map(|f| f.width * f.height).sum());
            sizes.width = frames.iter().map(|f| f.width).fold(sizes.width, u32::max);
            sizes.height = frames.iter().map(|f| f.height).fold(sizes.height, u32::max);
            sizes.loss_tiles = sizes.loss_tiles.max(tiles);
        }
        sizes
    }
}

impl LossBuffers {
    pub fn new(context: &Context, sizes: &Sizes, loss_map: bool) -> Result<Self, GpuError> {
        let partials = ssim_forward::partials_len(1, sizes.loss_tiles as u32);
        let map = if loss_map { sizes.pixels as usize } else { 1 };
        Ok(LossBuffers {
            partials: Buffer::new(context, "plane partials", partials, Location::Device)?,
            tile_sums: Buffer::new(context, "plane tile sums", sizes.loss_tiles, Location::Device)?,
            loss_map: Buffer::new(context, "plane loss map", map, Location::Device)?,
            losses: Buffer::new(context, "plane losses", sizes.frames, Location::Device)?,
        })
    }
}

/// The loss of a batch's images.
pub(super) struct BatchLoss<'a> {
    pub frames: &'a Buffer<Frame>,
    pub list: &'a [Frame],
    pub targets: &'a Buffer<u32>,
    pub buffers: &'a LossBuffers,
}

/// Tiles of the loss that matter to a step: a list for `ssim_forward` and one for `ssim_backward`.
pub(super) struct TileLists {
    pub marks: Buffer<u32>,
    /// Tiles of each list, and where the dispatches of that many workgroups are.
    pub count: Buffer<u32>,
    pub args: Buffer<u32>,
    pub lists: [Buffer<u32>; 2],
}

impl TileLists {
    pub fn new(context: &Context, tiles: usize) -> Result<Self, GpuError> {
        let words = |name: &str, len: usize| Buffer::new(context, name, len, Location::Device);
        Ok(TileLists {
            marks: words("tile marks", 2 * tiles)?,
            count: words("tile list counts", 2)?,
            args: words("tile list args", 6)?,
            lists: [words("forward tiles", tiles)?, words("backward tiles", tiles)?],
        })
    }
}

impl BatchLoss<'_> {
    pub fn tiles_per_frame(&self) -> u32 {
        ssim_forward::tiles_per_frame(self.list)
    }

    pub fn tile_count(&self) -> u32 {
        self.list.len() as u32 * self.tiles_per_frame()
    }

    /// With `lists` the stage must be one for listed tiles.
    pub fn forward(
        &self,
        recorder: &mut Recorder,
        stage: &SsimForward,
        image: &Buffer<[f32; 4]>,
        lists: Option<&TileLists>,
    ) {
        // Without a list of tiles `count` and `tile_list` are not read.
        let buffers = ssim_forward::Buffers {
            count: lists.map_or(self.targets, |l| &l.count),
            tile_list: lists.map_or(self.targets, |l| &l.lists[0]),
            frames: self.frames,
            image,
            targets: self.targets,
            partials: &self.buffers.partials,
            tile_sums: &self.buffers.tile_sums,
            loss_map: &self.buffers.loss_map,
        };
        let (tiles_per_frame, tile_count) = (self.tiles_per_frame(), self.tile_count());
        let push = ssim_forward::Push { frame_first: 0, tiles_per_frame, tile_count, count_index: 0 };
        match lists {
            Some(lists) => stage.record_list(recorder, &buffers, &push, &lists.args, 0),
            None => stage.record(recorder, &buffers, &push),
        }
    }

    pub fn backward(
        &self,
        recorder: &mut Recorder,
        stage: &SsimBackward,
        image: &Buffer<[f32; 4]>,
        image_grad: &Buffer<f32>,
        lists: &TileLists,
    ) {
        let buffers = ssim_backward::Buffers {
            count: &lists.count,
            tile_list: &lists.lists[1],
            frames: self.frames,
            image,
            targets: self.targets,
            partials: &self.buffers.partials,
            image_grad,
        };
        let (tiles_per_frame, tile_count) = (self.tiles_per_frame(), self.tile_count());
        let push = ssim_backward::Push { frame_first: 0, tiles_per_frame, tile_count, count_index: 1 };
        stage.record_list(recorder, &buffers, &push, &lists.args, 1);
    }

    pub fn sum(&self, recorder: &mut Recorder, stage: &LossSum) {
        let buffers =
            loss_sum::Buffers { frames: self.frames, tile_sums: &self.buffers.tile_sums, losses: &self.buffers.losses };
        let (frame_count, tiles_per_frame) = (self.list.len() as u32, self.tiles_per_frame());
        stage.record(recorder, &buffers, &loss_sum::Push { frame_first: 0, frame_count, tiles_per_frame, slot: 0 });
    }
}

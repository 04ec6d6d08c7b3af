//! Verifies the L1 + SSIM loss and its gradient.

use super::{Bench, sort::noise};
use crate::{
    error::Result,
    gpu::{Buffer, Recorder},
    pipelines::loss::{self as pipeline, LossOptions, Photometric, TileLists, Tiles},
    stages::{
        WORKGROUP, composite,
        ssim::{tiles_for, tiles_per_frame},
        types::Frame,
    },
};

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    // Whole and partial tiles, frames smaller than a tile and than the window.
    // (Scratch is sized by the largest frame: for these four it is a third of llvmpipe's buffer limit.)
    let first = if quick { (101, 75) } else { (800, 533) };
    let sizes = &[first, (64, 48), (5, 70), (1, 1)];
    for batch in [Batch::new(sizes), Batch::masked(sizes)] {
        for tiles in [Tiles::All, Tiles::Map, Tiles::Listed] {
            let there = There::new(bench, &batch)?;
            bench.run(|recorder| there.record(recorder, tiles))?;
        }
        // The random gradient of probes.
        let there = There::new(bench, &batch)?;
        for (f, &(width, height)) in sizes.iter().enumerate() {
            let batch = there.batch(f as u32, 1);
            bench.run(|r| there.loss.record_probe(r, &batch, &there.image_grad, width * height, 12_345))?;
        }
    }
    over_a_background(bench, if quick { 5003 } else { 500_003 })
}

/// Pixels of every opacity, over a background that is darker in one channel, lighter in the others.
fn over_a_background(bench: &Bench<'_>, pixels: u32) -> Result<()> {
    let (context, first) = (&bench.shadowed, 77);
    let stored: Vec<u32> = (0..first + pixels).map(noise).collect();
    let photographs = Buffer::from_slice(context, "photographs", &stored)?;
    let targets = Buffer::from_slice(context, "targets", &vec![9u32; pixels as usize])?;
    let spec = composite::Spec { workgroup_size: context.info().workgroup(WORKGROUP) };
    let stage = composite::Stage::new(context, &spec)?;
    let buffers = composite::Buffers { photographs: &photographs, targets: &targets };
    let push = composite::Push { first, pixels, change: [-127, 255, 64] };
    bench.run(|recorder| stage.record(recorder, &buffers, &push, pixels))
}

/// Whether a frame's tiles are in the tile list.
fn listed(frame: usize) -> bool {
    frame != 1
}

/// Frames one after the other in one image buffer; their targets are in another order, with a gap.
struct Batch {
    /// Offsets of each frame in both.
    frames: Vec<Frame>,
    /// sRGB and transmittance.
    image: Vec<[f32; 4]>,
    /// Packed 8-bit RGBA; alpha 0 masks a pixel.
    targets: Vec<u32>,
}

impl Batch {
    /// Gradients, edges, noise, flat bright areas (the hardest for float32 variances), colors above 1.
    fn new(sizes: &[(u32, u32)]) -> Self {
        let unit = |i: usize| (noise(i as u32) >> 8) as f32 / 16_777_216.0;
        let pixels = |&(width, height): &(u32, u32)| width * height;
        let mut batch = Batch { frames: vec![], image: vec![], targets: vec![0; 7] };
        for size in sizes {
            let image_first = batch.image.len() as u32;
            batch.frames.push(Frame { image_first, target_first: 0, width: size.0, height: size.1 });
            for i in 0..pixels(size) as usize {
                let (x, y) = ((i % size.0 as usize) as f32, (i / size.0 as usize) as f32);
                let flat = if x > 40.0 { 0.98 } else { 0.6 * (0.3 * x).sin() * (0.2 * y).cos() + 0.61 };
                let edge = if (x - y).abs() < 9.0 { 0.9 } else { 0.1 };
                batch.image.push([flat, edge + 0.1 * unit(i), (0.013 * y).min(1.2), unit(i + 5)]);
            }
        }
        for frame in batch.frames.iter_mut().rev() {
            frame.target_first = batch.targets.len() as u32;
            for i in 0..pixels(&(frame.width, frame.height)) as usize {
                let rgb = batch.image[frame.image_first as usize + i];
                let byte = |c: usize| ((rgb[c] + 0.1 * unit(3 * i + c) - 0.05).clamp(0.0, 1.0) * 255.0) as u32;
                batch.targets.push(byte(0) | byte(1) << 8 | byte(2) << 16 | 0x8000_0000);
            }
        }
        batch
    }

    /// [`Batch::new`] with masks: patches of several shapes, single pixels, and one frame without any valid
    /// pixel. The render differs strongly from the photograph there, so that any use of masked pixels shows.
    fn masked(sizes: &[(u32, u32)]) -> Self {
        let mut batch = Self::new(sizes);
        for (f, frame) in batch.frames.iter().enumerate() {
            for i in 0..frame.width * frame.height {
                let (x, y) = (i % frame.width, i / frame.width);
                let patch = (x / 13 + y / 9).is_multiple_of(3) || noise(i + 7).is_multiple_of(31);
                if patch || f == 1 {
                    batch.targets[(frame.target_first + i) as usize] &= 0x00FF_FFFF;
                    batch.image[(frame.image_first + i) as usize] = [7.0, -3.0, 5.0, 0.5];
                }
            }
        }
        batch
    }
}

/// A batch on the device. Buffers start as NaN, to reveal elements that kernels do not write.
struct There {
    frames: Buffer<Frame>,
    image: Buffer<[f32; 4]>,
    targets: Buffer<u32>,
    image_grad: Buffer<f32>,
    loss: Photometric,
    lists: TileLists,
    frame_count: u32,
    tiles_per_frame: u32,
}

impl There {
    fn new(bench: &Bench<'_>, batch: &Batch) -> Result<Self> {
        let context = &bench.shadowed;
        let (frame_count, tiles) = (batch.frames.len() as u32, tiles_per_frame(&batch.frames));
        let nans = |len| vec![f32::NAN; len];
        let list: Vec<u32> = (0..frame_count)
            .filter(|&f| listed(f as usize))
            .flat_map(|f| (0..tiles_for(&batch.frames[f as usize])).map(move |t| f * tiles + t))
            .collect();
        let options = LossOptions {
            tiles: frame_count * tiles,
            map_pixels: batch.image.len() as u32,
            losses: frame_count,
            listed: true,
            backward: true,
            probe: true,
        };
        let lists = TileLists::new(context, &options.tiles)?;
        lists.forward_tiles.upload(0, &list)?;
        lists.backward_tiles.upload(0, &list)?;
        lists.count.upload(0, &[list.len() as u32; 2])?;
        // More workgroups than tiles, as after a fold into two dimensions.
        lists.args.upload(0, &[list.len() as u32 / 2 + 1, 2, 1].repeat(2))?;
        let loss = Photometric::new(context, &options)?;
        loss.loss_map().upload(0, &nans(batch.image.len()))?;
        Ok(There {
            frames: Buffer::from_slice(context, "frames", &batch.frames)?,
            image: Buffer::from_slice(context, "image", &batch.image)?,
            targets: Buffer::from_slice(context, "targets", &batch.targets)?,
            image_grad: Buffer::from_slice(context, "image grad", &nans(3 * batch.image.len()))?,
            loss,
            lists,
            frame_count,
            tiles_per_frame: tiles,
        })
    }

    fn batch(&self, frame_first: u32, frame_count: u32) -> pipeline::Batch<'_> {
        let There { frames, image, targets, tiles_per_frame, .. } = self;
        pipeline::Batch { frames, frame_first, frame_count, tiles_per_frame: *tiles_per_frame, image, targets }
    }

    fn record(&self, recorder: &mut Recorder, tiles: Tiles) {
        let batch = self.batch(0, self.frame_count);
        self.loss.record_forward(recorder, &batch, tiles, Some(&self.lists));
        // The gradient has no variant with a map.
        let of = if tiles == Tiles::Map { Tiles::All } else { tiles };
        self.loss.record_backward(recorder, &batch, &self.image_grad, of, Some(&self.lists));
        self.loss.record_sum(recorder, &batch, 0);
    }
}

//! The L1 + SSIM loss and its gradient.

use super::Bench;
use crate::{
    error::Result,
    gpu::{Buffer, Recorder},
    pipelines::loss::{self as pipeline, LossOptions, Photometric, TileLists, Tiles},
    reference::{self, ssim_forward::SsimForward as Twin},
    stages::{
        ssim::{tiles_for, tiles_per_frame},
        types::Frame,
    },
    verify::{judge::Work, sort::noise},
};

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    // Whole and broken tiles, frames smaller than a tile and than the window.
    // (Scratch is as large for each frame as for the largest: four of these are a third of what llvmpipe binds.)
    let first = if quick { (101, 75) } else { (800, 533) };
    let sizes = &[first, (64, 48), (5, 70), (1, 1)];
    let (batch, masked) = (Batch::new(sizes), Batch::masked(sizes));
    // Each pixel and channel: five moments forward and three partials backward, filtered by eleven taps in each direction.
    let channels = 3.0 * batch.image.len() as f64;
    let pixels = batch.image.len() as f64;
    let (all, counting) = (batch.twins(), masked.twins());
    // Masks are in the targets, so every variant has them; they are looked at together with the map, which has them too.
    let cases =
        [(Tiles::All, ""), (Tiles::Map, "loss map"), (Tiles::Listed, "tile list"), (Tiles::Map, "loss map, masked")];
    for (tiles, name) in cases {
        let has_mask = name.ends_with("masked");
        let (batch, twins) = if has_mask { (&masked, &counting) } else { (&batch, &all) };
        let there = There::new(bench, batch)?;
        let times = bench.time(|recorder| there.record(recorder, tiles))?;
        let (gradient, map) = (there.image_grad.download()?, there.loss.loss_map().download()?);
        let losses = there.loss.losses.mapped();

        let (mut forward, mut backward) = (bench.row("ssim_forward", name), bench.row("ssim_backward", name));
        let mut sum = bench.row("loss_sum", name);
        for (f, (frame, (twin, twin_gradient))) in batch.frames.iter().zip(twins).enumerate() {
            let range = frame.image_first as usize..(frame.image_first + frame.width * frame.height) as usize;
            if tiles == Tiles::Listed && !listed(f) {
                // Tiles that are not listed keep what they had.
                let touched = gradient[3 * range.start..3 * range.end].iter().filter(|g| !g.is_nan()).count();
                backward.unequal(touched as u64);
                continue;
            }
            let [l1, squared, ssim, total] =
                reference::loss_sum::loss_sum(twin.sums, frame.width as usize, frame.height as usize);
            let loss = losses[f];
            sum.numbers([(loss.l1, l1), (loss.total, total)]);
            sum.numbers([(loss.squared, squared)]);
            // 1 − SSIM is what the loss is made of; SSIM itself is near 1.
            sum.numbers([(loss.ssim, ssim)]);
            if tiles == Tiles::Map {
                forward.numbers(map[range.clone()].iter().copied().zip(twin.loss_map.iter().copied()));
            } else {
                forward.unequal(map[range.clone()].iter().filter(|loss| !loss.is_nan()).count() as u64);
                forward.numbers([(loss.total, total)]);
            }
            let want = twin_gradient.iter().flatten().copied();
            backward.gradients(gradient[3 * range.start..3 * range.end].iter().copied().zip(want));
            if has_mask {
                // To the bit: where nothing counts nothing is drawn and nothing is learned.
                let left_out: Vec<usize> = range.filter(|&i| !batch.counts(frame, i)).collect();
                forward.unequal(left_out.iter().filter(|&&i| map[i] != 0.0).count() as u64);
                backward.unequal(left_out.iter().filter(|&&i| gradient[3 * i..3 * i + 3] != [0.0; 3]).count() as u64);
            }
        }
        // Training has all tiles, the screen phase a list, and a loss map where it draws.
        backward.chosen = tiles != Tiles::Map;
        let share = if tiles == Tiles::Listed { listed_share(batch) } else { 1.0 };
        let partials = 9.0 * 4.0 * pixels;
        let map_bytes = if tiles == Tiles::Map { 4.0 * pixels } else { 0.0 };
        forward.work =
            Work { bytes: share * (20.0 * pixels + partials) + map_bytes, operations: share * channels * (4.0 * 22.0) };
        backward.work =
            Work { bytes: share * (20.0 * pixels + partials + 12.0 * pixels), operations: share * channels * 66.0 };
        sum.work.bytes = 12.0 * f64::from(there.tiles_per_frame) * batch.frames.len() as f64;
        forward.time = times.of("ssim_forward");
        backward.time = times.of("ssim_backward");
        sum.time = times.of("loss_sum");
        bench.push(forward);
        bench.push(backward);
        if tiles == Tiles::All {
            bench.push(sum);
        }
    }
    probe(bench, &masked, sizes)
}

/// The gradient that is drawn.
fn probe(bench: &mut Bench<'_>, batch: &Batch, sizes: &[(u32, u32)]) -> Result<()> {
    let (there, step) = (There::new(bench, batch)?, 12_345);
    let times = bench.time(|recorder| {
        for (f, &(width, height)) in sizes.iter().enumerate() {
            let batch = there.batch(f as u32, 1);
            there.loss.record_probe(recorder, &batch, &there.image_grad, width * height, step);
        }
    })?;
    let got = there.image_grad.download()?;
    let mut row = bench.row("loss_probe", "");
    for (f, frame) in batch.frames.iter().enumerate() {
        let (image, targets) = batch.pixels(frame);
        let want = reference::loss_probe::loss_probe(&image, targets, f as u32, step);
        row.numbers(got[3 * frame.image_first as usize..].iter().copied().zip(want.into_iter().flatten()));
    }
    row.work.bytes = 32.0 * batch.image.len() as f64;
    row.time = times.of("loss_probe");
    bench.push(row);
    Ok(())
}

/// Frames whose tiles are in the tile list.
fn listed(frame: usize) -> bool {
    frame != 1
}

fn listed_share(batch: &Batch) -> f64 {
    let pixels = |f: &Frame| f64::from(f.width * f.height);
    let some: f64 = batch.frames.iter().enumerate().filter(|(i, _)| listed(*i)).map(|(_, f)| pixels(f)).sum();
    some / batch.image.len() as f64
}

/// Frames behind one another in one image buffer, their targets in another order with a gap.
pub struct Batch {
    /// Where each lies in both.
    pub frames: Vec<Frame>,
    /// sRGB and transmittance.
    pub image: Vec<[f32; 4]>,
    /// Packed 8-bit RGBA; alpha 0 does not count.
    pub targets: Vec<u32>,
}

impl Batch {
    /// Gradients, edges, noise, flat bright places (where float32 variances cancel most), colours above 1.
    pub fn new(sizes: &[(u32, u32)]) -> Self {
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

    /// The same with masks: patches of several shapes, single pixels, and one frame of which nothing counts. What is rendered
    /// there is far from the photograph, so that it shows wherever it is looked at.
    pub fn masked(sizes: &[(u32, u32)]) -> Self {
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

    /// Whether the pixel at `i` of the images, one of `frame`'s, counts.
    fn counts(&self, frame: &Frame, i: usize) -> bool {
        reference::ssim_forward::counts(self.targets[frame.target_first as usize + i - frame.image_first as usize])
    }

    fn twins(&self) -> Vec<(Twin, Vec<[f64; 3]>)> {
        let twin = |frame: &Frame| {
            let (width, height) = (frame.width as usize, frame.height as usize);
            let (image, targets) = self.pixels(frame);
            let forward = reference::ssim_forward::ssim_forward(width, height, &image, targets);
            let backward = reference::ssim_backward::ssim_backward(width, height, &image, targets, &forward.partials);
            (forward, backward)
        };
        self.frames.iter().map(twin).collect()
    }

    /// What the twins read of a frame.
    pub fn pixels(&self, frame: &Frame) -> (Vec<[f64; 4]>, &[u32]) {
        let pixels = (frame.width * frame.height) as usize;
        let image = &self.image[frame.image_first as usize..][..pixels];
        let targets = &self.targets[frame.target_first as usize..][..pixels];
        (image.iter().map(|p| p.map(f64::from)).collect(), targets)
    }
}

/// A batch on the device. What the kernels do not write is NaN.
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
        let context = bench.context;
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

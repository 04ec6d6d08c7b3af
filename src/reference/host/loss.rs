//! Host adapters of the photometric loss's twins.

use std::collections::BTreeMap;

use super::{Outcome, pixels, wide_rows};
use crate::{
    reference as twin,
    stages::{
        constants::ssim::TILE,
        kernels,
        ssim::{SSIM_WEIGHT, tiles_for},
        types::{Frame, Loss},
    },
};

twins!(composite, loss_probe, loss_sum, ssim_backward, ssim_forward);

/// The twins only have the method's weight.
fn check(ssim_weight: f32) -> Outcome {
    if ssim_weight == SSIM_WEIGHT {
        return Ok(());
    }
    Err(format!("the weight of SSIM is {ssim_weight}, the twin has {SSIM_WEIGHT} only"))
}

/// The tiles that a dispatch takes.
struct Tiles<'a> {
    frames: &'a [Frame],
    /// With a list, the tiles on it.
    list: Option<&'a [u32]>,
    tile_count: u32,
    tiles_per_frame: u32,
    groups: usize,
}

impl<'a> Tiles<'a> {
    /// The tiles of each frame, by its position.
    fn by_frame(&self) -> BTreeMap<usize, Vec<u32>> {
        let mut all = BTreeMap::<usize, Vec<u32>>::new();
        let mut add = |tile: u32| {
            let (f, tile) = ((tile / self.tiles_per_frame) as usize, tile % self.tiles_per_frame);
            if tile < tiles_for(&self.frames[f]) {
                all.entry(f).or_default().push(tile);
            }
        };
        match self.list {
            Some(list) => list[..list.len().min(self.groups)].iter().for_each(|&tile| add(tile)),
            None => (0..self.tile_count.min(self.groups as u32)).for_each(add),
        }
        all
    }
}

/// Columns and rows of a frame's pixels in a tile.
fn pixels_of(frame: &Frame, tile: u32) -> impl Iterator<Item = (u32, u32)> {
    let (width, height) = (frame.width, frame.height);
    let across = width.div_ceil(TILE);
    let (left, top) = (tile % across * TILE, tile / across * TILE);
    (top..(top + TILE).min(height)).flat_map(move |y| (left..(left + TILE).min(width)).map(move |x| (x, y)))
}

/// Index of the partial derivatives of a pixel's channel; `partial_index` of `glsl/shared/runs.glsl`.
fn partials_at(
    frame: &Frame,
    f: usize,
    tiles_per_frame: u32,
    [run, rows]: [u32; 2],
    channel: usize,
    (x, y): (u32, u32),
) -> usize {
    let strip_pixels = (TILE * rows) as usize;
    let strip = f as u32 * tiles_per_frame * (TILE / rows) + y / rows * frame.width.div_ceil(TILE) + x / TILE;
    let within = x % run * (TILE / run * rows) + x % TILE / run * rows + y % rows;
    (3 * strip as usize + channel) * strip_pixels + within as usize
}

/// A frame's pixels as read by the kernels of the loss.
fn read<'a>(frame: &Frame, image: &[[f32; 4]], targets: &'a [u32]) -> (Vec<[f64; 4]>, &'a [u32]) {
    let pixels = pixels(frame);
    let targets = &targets[frame.target_first as usize..][..pixels.len()];
    (wide_rows(&image[pixels]), targets)
}

pub(super) fn ssim_forward(h: kernels::ssim_forward::Host<'_>) -> Outcome {
    let kernels::ssim_forward::Push { frame_first, tiles_per_frame, tile_count, count_index } = h.push;
    let kernels::ssim_forward::Spec { tile_list, ssim_weight, loss_map, run, strip, .. } = h.spec;
    check(ssim_weight)?;
    let frames = &h.frames[frame_first as usize..];
    let list = tile_list.then(|| &h.tile_list[..h.count[count_index as usize] as usize]);
    let tiles = Tiles { frames, list, tile_count, tiles_per_frame, groups: h.workgroups.groups() };
    for (f, tiles) in tiles.by_frame() {
        let frame = &frames[f];
        let (image, targets) = read(frame, h.image, h.targets);
        let forward = twin::ssim_forward::ssim_forward(frame.width as usize, frame.height as usize, &image, targets);
        for tile in tiles {
            let mut sums = [0.0; 3];
            for (x, y) in pixels_of(frame, tile) {
                let pixel = (y * frame.width + x) as usize;
                sums.iter_mut().zip(forward.pixel_sums[pixel]).for_each(|(sum, part)| *sum += part);
                for (channel, partials) in forward.partials[pixel].iter().enumerate() {
                    let at = partials_at(frame, f, tiles_per_frame, [run, strip], channel, (x, y));
                    h.partials[at] = partials.map(|p| p as f32);
                }
                if loss_map {
                    h.loss_map[frame.image_first as usize + pixel] = forward.loss_map[pixel] as f32;
                }
            }
            h.tile_sums[f * tiles_per_frame as usize + tile as usize] = sums.map(|sum| sum as f32);
        }
    }
    Ok(())
}

pub(super) fn ssim_backward(h: kernels::ssim_backward::Host<'_>) -> Outcome {
    let kernels::ssim_backward::Push { frame_first, tiles_per_frame, tile_count, count_index } = h.push;
    let kernels::ssim_backward::Spec { tile_list, ssim_weight, run, strip, .. } = h.spec;
    check(ssim_weight)?;
    let frames = &h.frames[frame_first as usize..];
    let list = tile_list.then(|| &h.tile_list[..h.count[count_index as usize] as usize]);
    let tiles = Tiles { frames, list, tile_count, tiles_per_frame, groups: h.workgroups.groups() };
    for (f, tiles) in tiles.by_frame() {
        let frame = &frames[f];
        let (image, targets) = read(frame, h.image, h.targets);
        // Tiles that are not listed may hold any values; no listed tile reads them.
        let partials: Vec<[[f64; 3]; 3]> = (0..frame.height)
            .flat_map(|y| (0..frame.width).map(move |x| (x, y)))
            .map(|pixel| {
                [0, 1, 2]
                    .map(|c| h.partials[partials_at(frame, f, tiles_per_frame, [run, strip], c, pixel)].map(f64::from))
            })
            .collect();
        let (width, height) = (frame.width as usize, frame.height as usize);
        let grads = twin::ssim_backward::ssim_backward(width, height, &image, targets, &partials);
        for (x, y) in tiles.into_iter().flat_map(|tile| pixels_of(frame, tile)) {
            let pixel = (y * frame.width + x) as usize;
            let to = &mut h.image_grad[3 * (frame.image_first as usize + pixel)..][..3];
            to.iter_mut().zip(grads[pixel]).for_each(|(to, g)| *to = g as f32);
        }
    }
    Ok(())
}

pub(super) fn composite(h: kernels::composite::Host<'_>) -> Outcome {
    let kernels::composite::Push { first, pixels, change } = h.push;
    let count = h.workgroups.threads().min(pixels as usize);
    let stored = &h.photographs[first as usize..][..count];
    h.targets.iter_mut().zip(stored).for_each(|(to, &stored)| *to = twin::composite::composite(stored, change));
    Ok(())
}

pub(super) fn loss_probe(h: kernels::loss_probe::Host<'_>) -> Outcome {
    let kernels::loss_probe::Push { frame: index, step } = h.push;
    check(h.spec.ssim_weight)?;
    let frame = &h.frames[index as usize];
    let (image, targets) = read(frame, h.image, h.targets);
    let probe = twin::loss_probe::loss_probe(&image, targets, index, step);
    let grads = h.image_grad[3 * frame.image_first as usize..].chunks_exact_mut(3);
    for (to, from) in grads.zip(&probe).take(h.workgroups.threads()) {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from as f32);
    }
    Ok(())
}

pub(super) fn loss_sum(h: kernels::loss_sum::Host<'_>) -> Outcome {
    let kernels::loss_sum::Push { frame_first, frame_count, tiles_per_frame, first } = h.push;
    check(h.spec.ssim_weight)?;
    let count = h.workgroups.groups().min(frame_count as usize);
    for (f, frame) in h.frames[frame_first as usize..][..count].iter().enumerate() {
        let tiles = &h.tile_sums[f * tiles_per_frame as usize..][..tiles_for(frame) as usize];
        let sums = [0, 1, 2].map(|k| tiles.iter().map(|sums| f64::from(sums[k])).sum());
        let loss = twin::loss_sum::loss_sum(sums, frame.width as usize, frame.height as usize);
        let [l1, squared, ssim, total] = loss.map(|v| v as f32);
        h.losses[first as usize + f] = Loss { l1, squared, ssim, total };
    }
    Ok(())
}

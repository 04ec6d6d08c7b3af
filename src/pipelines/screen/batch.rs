//! Splits views into batches that fit the device.

use std::ops::Range;

use super::rig::LEARNED;
use crate::{
    error::{Error, Result},
    gpu::Context,
    pipelines::views::Views,
    stages::{
        ssim::{TILE, tiles_per_frame},
        types::Frame,
    },
};

/// Maximum pixels of a batch. A pixel needs 88 bytes of working memory, so this is 1.5 GB; 26 views of 800 ×
/// 800.
pub const BATCH_PIXELS: u64 = 1 << 24;

/// Splits views into batches of at most `pixels` that the device's buffers hold: consecutive views with
/// photographs in one page, at least one each.
pub fn batches(context: &Context, views: &Views, pixels: u64) -> Vec<Range<usize>> {
    // The largest buffer of a batch has 9 floats for each pixel.
    let limit = pixels.min(context.info().max_storage_bytes / 36);
    let sizes: Vec<[u32; 2]> = views.cameras.iter().map(|camera| [camera.width, camera.height]).collect();
    split(&sizes, limit, |first| views.same_page(first))
}

/// Batches of views of these sizes with at most `limit` pixels each, counted in whole tiles and each view as
/// the batch's largest. From view `first` on, `same_page(first)` views lie in one page.
fn split(sizes: &[[u32; 2]], limit: u64, same_page: impl Fn(usize) -> usize) -> Vec<Range<usize>> {
    let mut list = Vec::new();
    let (mut first, mut largest) = (0, 0);
    for (v, size) in sizes.iter().enumerate() {
        let [across, down] = size.map(|side| u64::from(side.next_multiple_of(TILE)));
        let padded = largest.max(across * down);
        let full = (v + 1 - first) as u64 * padded > limit || v - first >= same_page(first);
        if v > first && full {
            list.push(first..v);
            first = v;
            largest = across * down;
        } else {
            largest = padded;
        }
    }
    if first < sizes.len() {
        list.push(first..sizes.len());
    }
    list
}

/// Frames of a batch: images packed one after the other, targets at their photographs.
pub fn frames_of(views: &Views, batch: &Range<usize>) -> Vec<Frame> {
    let mut image_first = 0;
    let packed = |frame: &Frame| {
        let first = image_first;
        image_first += frame.width * frame.height;
        Frame { image_first: first, ..*frame }
    };
    views.frame_list[batch.clone()].iter().map(packed).collect()
}

/// Maximum sizes over `batches`, with this budget of 2D Gaussians for each view.
///
/// # Errors
/// [`Error::Usage`] if the budget of a batch is more than the device can address.
pub fn sizes_of(views: &Views, batches: &[Range<usize>], budgets: &[u32]) -> Result<ScreenSizes> {
    let mut sizes = ScreenSizes::default();
    for batch in batches {
        let places = budgets[batch.clone()].iter().map(|&n| u64::from(n)).sum::<u64>();
        let places = u32::try_from(places).ok().filter(|&n| n <= u32::MAX / (2 * LEARNED as u32));
        let places = places.ok_or_else(|| {
            Error::Usage("the budget is more 2D Gaussians at once than the device can address".into())
        })?;
        sizes = sizes.max(ScreenSizes::of_frames(&frames_of(views, batch), places));
    }
    Ok(sizes)
}

/// Maximum sizes over all batches.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ScreenSizes {
    /// Places for 2D Gaussians.
    pub places: u32,
    /// Views of the batch.
    pub frames: u32,
    /// Pixels of all frames together.
    pub pixels: u32,
    /// Width of the widest frame, px.
    pub width: u32,
    /// Height of the tallest frame, px.
    pub height: u32,
    /// Tiles of the loss; each frame of a batch counts as its largest.
    pub loss_tiles: u32,
}

impl ScreenSizes {
    /// Sizes of one batch of these frames.
    pub fn of_frames(frames: &[Frame], places: u32) -> Self {
        ScreenSizes {
            places: places.max(1),
            frames: frames.len() as u32,
            pixels: frames.iter().map(|f| f.width * f.height).sum(),
            width: frames.iter().map(|f| f.width).max().unwrap_or(1),
            height: frames.iter().map(|f| f.height).max().unwrap_or(1),
            loss_tiles: frames.len() as u32 * tiles_per_frame(frames),
        }
    }

    /// Sizes that fit both.
    pub fn max(self, other: Self) -> Self {
        ScreenSizes {
            places: self.places.max(other.places),
            frames: self.frames.max(other.frames),
            pixels: self.pixels.max(other.pixels),
            width: self.width.max(other.width),
            height: self.height.max(other.height),
            loss_tiles: self.loss_tiles.max(other.loss_tiles),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_are_as_large_as_the_device_holds_and_lie_in_one_page() {
        // 33 × 31 pixels touch two tiles of 32 × 32.
        let (small, large) = ([33, 31], [64, 96]);
        let all = |_| usize::MAX;
        let of = |sizes: &[[u32; 2]], limit| split(sizes, limit, all);
        assert_eq!(of(&[small; 5], 4096), [0..2, 2..4, 4..5]);
        assert_eq!(of(&[small; 5], 4095), [0..1, 1..2, 2..3, 3..4, 4..5]);
        assert_eq!(of(&[small; 5], 1 << 24).len(), 1);
        // Each view counts as the largest of its batch; a view beyond the limit forms a batch alone.
        assert_eq!(of(&[small, small, large, small, small], 3 * 2048), [0..2, 2..3, 3..5]);
        assert_eq!(of(&[large; 2], 1), [0..1, 1..2]);
        assert!(of(&[], 1).is_empty());
        // Pages of three.
        assert_eq!(split(&[small; 7], 1 << 24, |first| 3 - first % 3), [0..3, 3..6, 6..7]);
    }
}

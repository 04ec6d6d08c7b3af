//! Sizes of the L1 + SSIM loss, whose workgroups take tiles.

use super::types::Frame;
use crate::gpu::DeviceInfo;

pub use super::constants::ssim::{TILE, WORKGROUP};

/// Weight of 1 − SSIM in the loss; |x − y| has the rest (Kerbl et al. 2023).
pub const SSIM_WEIGHT: f32 = 0.2;
/// Threads that sum a frame's tiles: a frame of 1600 × 1064 pixels has 1700.
pub const SUM_WORKGROUP: u32 = 256;

/// Pixels of a row that one thread filters, and rows that pass through shared memory at a time. On a GPU both
/// are small, so that many workgroups' registers and shared memory fit at once; three quarters of a
/// workgroup's threads then have a run. On a CPU a run is a whole row of a tile, as every run reads the
/// border again, and there are 8 rows, one for each lane of a vector.
pub fn run_and_strip_for(device: &DeviceInfo) -> [u32; 2] {
    if device.constant_lanes().is_some() { [TILE, 8] } else { [4, 4] }
}

/// Tiles of a frame. Tile t is column t mod ⌈width / [`TILE`]⌉; its number among all is frame × tiles_per_frame + t.
pub fn tiles_for(frame: &Frame) -> u32 {
    frame.width.div_ceil(TILE) * frame.height.div_ceil(TILE)
}

/// The largest number of tiles of any frame, allotted to each in `partials` and `tile_sums`.
pub fn tiles_per_frame(frames: &[Frame]) -> u32 {
    frames.iter().map(tiles_for).max().unwrap_or(0)
}

/// Elements of `partials` for `tiles` tiles: one for each channel of each pixel.
pub fn partials_len(tiles: u32) -> usize {
    tiles as usize * (3 * TILE * TILE) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_hold_what_the_kernels_write() {
        let frame = |width, height| Frame { width, height, ..Default::default() };
        assert_eq!([(1, 1), (32, 32), (33, 32), (64, 48)].map(|(w, h)| tiles_for(&frame(w, h))), [1, 1, 2, 4]);
        assert_eq!(tiles_per_frame(&[frame(17, 3), frame(64, 48)]), 4);
        assert_eq!(partials_len(8), 8 * 3072);
    }
}

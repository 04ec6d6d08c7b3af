//! Twin of `loss_probe.comp`.

use super::{
    hash::pcg4d,
    ssim_forward::{SSIM_WEIGHT, counts, target_channel},
};

/// What a difference between render and photograph counts as at least.
pub const LEAST_DIFFERENCE: f64 = 0.01;

/// Counter of the hash, apart from those of density control.
const HASH_PROBE: u32 = 5;

/// A gradient by RGB of each pixel of frame `frame`, row by row, whose signs are drawn anew in each `step`.
pub fn loss_probe(image: &[[f64; 4]], targets: &[u32], frame: u32, step: u32) -> Vec<[f64; 3]> {
    let scale = (1.0 - SSIM_WEIGHT) / (3.0 * image.len() as f64);
    let of = |(i, (rgba, &target)): (usize, (&[f64; 4], &u32))| {
        let h = pcg4d([i as u32, frame, step, HASH_PROBE]);
        std::array::from_fn(|c| {
            if !counts(target) {
                return 0.0;
            }
            let root = (scale / (rgba[c] - target_channel(target, c)).abs().max(LEAST_DIFFERENCE)).sqrt();
            if h[c] >> 31 == 0 { root } else { -root }
        })
    };
    image.iter().zip(targets).enumerate().map(of).collect()
}

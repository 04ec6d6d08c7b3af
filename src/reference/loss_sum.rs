//! Twin of `loss_sum.comp`: the losses of a frame from its sums.

use super::ssim_forward::SSIM_WEIGHT;

/// Means over pixels and channels of |x − y|, of (x − y)² and of SSIM, and the loss computed from them.
pub fn loss_sum(sums: [f64; 3], width: usize, height: usize) -> [f64; 4] {
    let [l1, squared, ssim] = sums.map(|sum| sum / (3.0 * width as f64 * height as f64));
    [l1, squared, ssim, (1.0 - SSIM_WEIGHT) * l1 + SSIM_WEIGHT * (1.0 - ssim)]
}

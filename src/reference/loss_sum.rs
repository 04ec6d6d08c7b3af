//! Twin of `loss_sum.comp`.

use super::ssim_forward::SSIM_WEIGHT;

/// Means over pixels and channels of |x − y| and of SSIM, and the loss made of them, from the frame's sums.
pub fn loss_sum(sums: [f64; 2], width: usize, height: usize) -> [f64; 3] {
    let [l1, ssim] = sums.map(|sum| sum / (3.0 * width as f64 * height as f64));
    [l1, ssim, (1.0 - SSIM_WEIGHT) * l1 + SSIM_WEIGHT * (1.0 - ssim)]
}

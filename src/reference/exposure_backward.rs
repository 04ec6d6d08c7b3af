//! Twin of `exposure_backward.comp`: gradients through a photograph's map of colors.

use super::exposure_apply::Map;

/// Pixels over which the gradient of a map is summed together.
pub const SUM_PIXELS: usize = 1024;

/// Turns `grads`, by the corrected image's colors, into those by the blended image's, Mᵀ g. Returns the
/// gradient of the map, Σ g (c, 1)ᵀ over each [`SUM_PIXELS`] pixels. `image` is RGB and transmittance of each
/// pixel before the correction.
pub fn exposure_backward(map: &Map, image: &[[f64; 4]], grads: &mut [[f64; 3]]) -> Vec<Map> {
    let mut sums = vec![[0.0; 12]; image.len().div_ceil(SUM_PIXELS)];
    for (pixel, (&[r, g, b, _], grad)) in image.iter().zip(grads).enumerate() {
        let sum = &mut sums[pixel / SUM_PIXELS];
        let mut to_image = [0.0; 3];
        for (row, &of_row) in grad.iter().enumerate() {
            // If the gradient is 0 the rendered color may be any value, even NaN.
            if of_row != 0.0 {
                [r, g, b, 1.0].iter().enumerate().for_each(|(column, c)| sum[4 * row + column] += of_row * c);
            }
            to_image.iter_mut().enumerate().for_each(|(c, to)| *to += of_row * map[4 * row + c]);
        }
        *grad = to_image;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{
        exposure_apply::exposure_apply,
        loss_sum::loss_sum,
        ssim_backward::ssim_backward,
        ssim_forward::{ssim_forward, tests::pictures},
    };

    const MAP: Map = [1.1, -0.05, 0.02, 0.03, 0.04, 0.9, -0.1, -0.02, 0.07, 0.01, 1.05, 0.015];
    const SIZE: (usize, usize) = (64, 48);

    fn loss(map: &Map, image: &[[f64; 4]], targets: &[u32]) -> f64 {
        let (width, height) = SIZE;
        let forward = ssim_forward(width, height, &exposure_apply(map, image), targets);
        let [.., total] = loss_sum(forward.sums, width, height);
        total
    }

    /// Gradients of the loss by the map and by the blended image, for a picture with pixels that do not
    /// count.
    #[test]
    fn gradients_through_the_loss_are_central_differences() {
        let (width, height) = SIZE;
        let (mut image, mut targets) = pictures(width, height);
        for pixel in (0..image.len()).filter(|pixel| pixel % width < 9) {
            targets[pixel] &= 0x00FF_FFFF;
            image[pixel] = [f64::NAN, 7.0, -3.0, 0.0];
        }
        let corrected = exposure_apply(&MAP, &image);
        let forward = ssim_forward(width, height, &corrected, &targets);
        let mut grads = ssim_backward(width, height, &corrected, &targets, &forward.partials);
        let sums = exposure_backward(&MAP, &image, &mut grads);
        assert_eq!(sums.len(), 3);
        let step = 1e-6;
        for entry in 0..12 {
            let moved = |by: f64| {
                let mut map = MAP;
                map[entry] += by;
                loss(&map, &image, &targets)
            };
            let (got, want) = (sums.iter().map(|s| s[entry]).sum::<f64>(), (moved(step) - moved(-step)) / (2.0 * step));
            // An |x − y| that changes sign within the step is a kink: 1e-6 of 7,000 values of range 0.2.
            assert!((got - want).abs() < 1e-4 * want.abs() + 1e-5, "entry {entry}: {got} and {want}");
        }
        for pixel in (0..image.len()).step_by(97) {
            for c in 0..3 {
                if pixel % width < 9 {
                    assert_eq!(grads[pixel][c], 0.0);
                    continue;
                }
                let moved = |by: f64| {
                    let mut image = image.clone();
                    image[pixel][c] += by;
                    loss(&MAP, &image, &targets)
                };
                let (got, want) = (grads[pixel][c], (moved(step) - moved(-step)) / (2.0 * step));
                assert!((got - want).abs() < 1e-4 * want.abs() + 1e-8, "pixel {pixel}: {got} and {want}");
            }
        }
    }
}

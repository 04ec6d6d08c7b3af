//! Twin of `ssim_backward.comp`: the gradient of the loss by the rendered pixels.

use super::ssim_forward::{MIDDLE, SSIM_WEIGHT, counts, filter, target_channel};

/// ∂loss/∂RGB per pixel, row by row, from the partials of [`super::ssim_forward::ssim_forward`].
pub fn ssim_backward(
    width: usize,
    height: usize,
    image: &[[f64; 4]],
    targets: &[u32],
    partials: &[[[f64; 3]; 3]],
) -> Vec<[f64; 3]> {
    let blurred = filter(width, height, partials, [0.0; 3]);
    let scale = 1.0 / (3.0 * width as f64 * height as f64);
    (0..width * height)
        .map(|i| {
            std::array::from_fn(|c| {
                if !counts(targets[i]) {
                    return 0.0;
                }
                let (x, y) = (image[i][c], target_channel(targets[i], c));
                let [p0, p1, p2] = blurred[i][c];
                let ssim = p0 + 2.0 * (x - MIDDLE) * p1 + (y - MIDDLE) * p2;
                // f64::signum(0.0) is 1.
                let sign = f64::from(i8::from(x > y) - i8::from(x < y));
                scale * ((1.0 - SSIM_WEIGHT) * sign - SSIM_WEIGHT * ssim)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::{
        loss_sum::loss_sum,
        ssim_forward::{
            ssim_forward,
            tests::{SIZES, pictures},
        },
    };
    use super::*;

    /// With a mask the loss is that of the counted pixels alone: other pixels' colors change nothing, and they
    /// have no gradient.
    #[test]
    fn the_gradient_is_the_central_difference_of_the_loss() {
        for ((width, height), is_masked) in SIZES.into_iter().flat_map(|size| [(size, false), (size, true)]) {
            let (mut image, mut targets) = pictures(width, height);
            let pixels = width * height;
            let masked = |i: usize| is_masked && (i % width + 3 * (i / width)) % 7 < 3;
            (0..pixels).filter(|&i| masked(i)).for_each(|i| targets[i] &= 0x00FF_FFFF);
            let forward = ssim_forward(width, height, &image, &targets);
            let gradient = ssim_backward(width, height, &image, &targets, &forward.partials);
            let mut other = image.clone();
            (0..pixels).filter(|&i| masked(i)).for_each(|i| other[i] = [0.9, 7.0, -1.0, 0.0]);
            assert_eq!(forward.sums, ssim_forward(width, height, &other, &targets).sums);
            // All pixels of the small pictures; of the large one every 41st, over all columns modulo the tile.
            for i in (0..pixels).step_by(if pixels > 100 { 41 } else { 1 }) {
                if masked(i) {
                    assert_eq!((gradient[i], forward.loss_map[i]), ([0.0; 3], 0.0));
                    continue;
                }
                for c in 0..3 {
                    // Truncation ~ step² and rounding ~ 1e-16 / step are both near 1e-10 of a gradient ~ 1 / pixels.
                    let (x, step) = (image[i][c], 1e-5);
                    assert!((x - target_channel(targets[i], c)).abs() > step, "the kink of |x - y|");
                    let mut loss_at = |value| {
                        image[i][c] = value;
                        loss_sum(ssim_forward(width, height, &image, &targets).sums, width, height)[3]
                    };
                    let difference = (loss_at(x + step) - loss_at(x - step)) / (2.0 * step);
                    loss_at(x);
                    let (got, error) = (gradient[i][c], (difference - gradient[i][c]).abs() * pixels as f64);
                    assert!(error < 1e-5, "{width}x{height}, pixel {i}, channel {c}: {difference} for {got}");
                }
            }
        }
    }

    #[test]
    fn equal_pictures_have_no_gradient() {
        let targets = [0xFF20_4060; 12];
        let image = [[f64::from(0x60) / 255.0, f64::from(0x40) / 255.0, f64::from(0x20) / 255.0, 1.0]; 12];
        let partials = ssim_forward(4, 3, &image, &targets).partials;
        let gradient = ssim_backward(4, 3, &image, &targets, &partials);
        assert!(gradient.iter().flatten().all(|g| g.abs() < 1e-12));
    }
}

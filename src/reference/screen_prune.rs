//! Twin of `screen_prune.comp`: decides which 2D Gaussians stay (method, section 3). One iteration is one
//! subgroup of the kernel.

use super::lift_count::make_footprint;
use super::screen_project::{ANGLE, LOG_SCALE, LOGIT, ScreenGaussian};
use super::sigmoid;

/// Smallest opacity, without compensation.
pub const OPACITY_MIN: f64 = 0.005;

/// Smallest number of covered pixels in an image of that size: 25 from 546 rows or columns on, fewer in
/// proportion to the area below, 4 at least.
pub fn covered_min(width: u32, height: u32) -> usize {
    let side = f64::from(width.min(height)) / 546.0;
    (25.0 * side * side).ceil().clamp(4.0, 25.0) as usize
}

/// Pixels of the image with α ≥ 1/255, regardless of Gaussians in front.
pub fn covered(gaussian: &ScreenGaussian, width: u32, height: u32) -> usize {
    let log_scale = [gaussian[LOG_SCALE], gaussian[LOG_SCALE + 1]];
    let footprint =
        make_footprint([gaussian[0], gaussian[1]], gaussian[LOGIT], log_scale, gaussian[ANGLE], [width, height], true);
    footprint.map_or(0, |f| f.pixels().filter(|&(x, y)| f.weight(x, y).is_some()).count())
}

/// True for each Gaussian that stays.
pub fn screen_prune(gaussians: &[ScreenGaussian], width: u32, height: u32) -> Vec<bool> {
    gaussians
        .iter()
        .map(|gaussian| {
            sigmoid(gaussian[LOGIT]) >= OPACITY_MIN && covered(gaussian, width, height) >= covered_min(width, height)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::reference::lift_count::screen_covariance;

    #[test]
    fn counts_are_those_of_all_pixels_of_the_image() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut kept, mut dropped) = (0, 0);
        for _ in 0..600 {
            let mut gaussian = [0.5; 10];
            gaussian[0] = rng.random_range(-2.0..42.0);
            gaussian[1] = rng.random_range(-2.0..32.0);
            gaussian[LOGIT] = rng.random_range(-6.5..3.0);
            gaussian[LOG_SCALE] = rng.random_range(-2.0..2.5);
            gaussian[LOG_SCALE + 1] = rng.random_range(-2.0..2.5);
            gaussian[ANGLE] = rng.random_range(-1.6..1.6);
            let [a, b, c] = screen_covariance([gaussian[LOG_SCALE], gaussian[LOG_SCALE + 1]], gaussian[ANGLE]);
            let (det0, det) = (a * c - b * b, (a + 0.3) * (c + 0.3) - b * b);
            let compensation = (det0 / det).sqrt();
            // Compensated, and as the footprint of a lift.
            let mut counts = [0; 2];
            for (row, column) in (0..30).flat_map(|row| (0..40).map(move |column| (row, column))) {
                let (dx, dy) = (column as f64 + 0.5 - gaussian[0], row as f64 + 0.5 - gaussian[1]);
                let power = ((c + 0.3) * dx * dx - 2.0 * b * dx * dy + (a + 0.3) * dy * dy) / det;
                for (count, factor) in counts.iter_mut().zip([compensation, 1.0]) {
                    let alpha = sigmoid(gaussian[LOGIT]) * factor * (-0.5 * power).exp();
                    *count += usize::from(alpha >= 1.0 / 255.0);
                }
            }
            let [x, y, .., s, t, angle, _] = gaussian;
            let lifted = make_footprint([x, y], gaussian[LOGIT], [s, t], angle, [40, 30], false);
            let lifted = lifted.map_or(0, |f| f.pixels().filter(|&(x, y)| f.weight(x, y).is_some()).count());
            assert_eq!([covered(&gaussian, 40, 30), lifted], counts);
            let keep = screen_prune(&[gaussian], 40, 30)[0];
            assert_eq!((covered_min(40, 30), covered_min(128, 128), covered_min(979, 546)), (4, 4, 25));
            assert_eq!(keep, counts[0] >= 4 && sigmoid(gaussian[LOGIT]) >= 0.005);
            *(if keep { &mut kept } else { &mut dropped }) += 1;
        }
        assert!(kept > 100 && dropped > 100);
    }
}

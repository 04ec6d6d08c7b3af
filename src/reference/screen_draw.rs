//! Twin of `screen_draw.comp`: draws pixels with high loss in a view (method, section 3; Efraimidis and
//! Spirakis 2006).
//!
//! One call is one workgroup of the kernel.

use super::hash::pcg4d;
use super::screen_backward::FIRST_SCALE_MIN;
use super::screen_project::{COLOR, LOG_SCALE, LOGIT, ScreenGaussian};

/// Losses whose square float32 can hold; a pixel with another loss is never drawn.
pub const LOSS_RANGE: std::ops::RangeInclusive<f64> = 1e-18..=1e18;
/// Opacity of a new Gaussian.
pub const FIRST_OPACITY: f64 = 0.02;
/// Standard deviation of a new Gaussian, relative to the shorter side.
pub const FIRST_SCALE: f64 = 0.005;

/// Identifies a draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Draw {
    /// Seed of the run.
    pub seed: u32,
    /// Index in the dataset.
    pub view: u32,
    /// From 1.
    pub round: u32,
}

/// Hash of a draw and a pixel.
fn hash(draw: Draw, pixel: u32) -> u32 {
    pcg4d([pixel, draw.view, draw.round, draw.seed])[3]
}

/// −ln(u) / loss², u a hash of the draw and the pixel; none if the pixel cannot be drawn.
pub fn key(draw: Draw, pixel: u32, loss: f64) -> Option<f64> {
    let x = (hash(draw, pixel) as f64 + 0.5) / 4294967296.0;
    LOSS_RANGE.contains(&loss).then(|| -(-x).ln_1p() / (loss * loss))
}

/// Most Gaussians that a view gets in one draw. (The method's round(0.2 n) is 0 for n < 3, and such a view
/// would never get any.)
pub fn draw_size(budget: u32) -> u32 {
    ((budget + 2) / 5).max(1)
}

/// The pixels of the `count` smallest keys, ascending; fewer if fewer can be drawn. `losses` by pixel.
pub fn screen_draw(draw: Draw, losses: &[f64], count: usize) -> Vec<u32> {
    let mut keys: Vec<(f64, u32)> =
        losses.iter().enumerate().filter_map(|(p, &loss)| Some((key(draw, p as u32, loss)?, p as u32))).collect();
    keys.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut drawn: Vec<u32> = keys.iter().take(count).map(|&(_, pixel)| pixel).collect();
    drawn.sort_unstable();
    drawn
}

/// The Gaussian put on a drawn pixel; `image` is RGB and transmittance of the refined render.
pub fn new_screen_gaussian(pixel: u32, image: &[[f64; 4]], width: u32, height: u32) -> ScreenGaussian {
    let mut gaussian = [0.0; 10];
    gaussian[0] = f64::from(pixel % width) + 0.5;
    gaussian[1] = f64::from(pixel / width) + 0.5;
    for c in 0..3 {
        gaussian[COLOR + c] = image[pixel as usize][c].clamp(0.0, 1.0);
    }
    gaussian[LOGIT] = (FIRST_OPACITY / (1.0 - FIRST_OPACITY)).ln();
    let log_scale = (FIRST_SCALE * f64::from(width.min(height))).clamp(FIRST_SCALE_MIN, 50.0).ln();
    gaussian[LOG_SCALE] = log_scale;
    gaussian[LOG_SCALE + 1] = log_scale;
    gaussian
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn draw(seed: u32) -> Draw {
        Draw { seed, view: 3, round: 2 }
    }

    proptest! {
        #[test]
        fn as_many_different_drawable_pixels_as_asked_for(
            losses in prop::collection::vec(prop_oneof![Just(0.0), Just(f64::NAN), 0.0..1.2f64], 0..200),
            count in 0usize..100,
            seed: u32,
        ) {
            let drawn = screen_draw(draw(seed), &losses, count);
            let drawable = losses.iter().filter(|loss| LOSS_RANGE.contains(*loss)).count();
            prop_assert_eq!(drawn.len(), count.min(drawable));
            prop_assert!(drawn.is_sorted_by(|a, b| a < b));
            prop_assert!(drawn.iter().all(|&p| losses[p as usize] > 0.0));
        }
    }

    /// Two of three without replacement, 40,000 times: pixel p is left out with probability Σ over the orders of the other two, with a
    /// standard deviation of at most 0.0025. Five of them bound it.
    #[test]
    fn the_second_pixel_is_drawn_in_proportion_to_what_is_left() {
        let losses: [f64; 3] = [1.0, 2.0, 3.0f64.sqrt()];
        let w = losses.map(|l| l * l);
        let total: f64 = w.iter().sum();
        let mut left_out = [0.0; 3];
        for seed in 0..40_000 {
            let drawn = screen_draw(draw(seed), &losses, 2);
            left_out[(0..3).find(|p| !drawn.contains(p)).unwrap() as usize] += 1.0 / 40_000.0;
        }
        for p in 0..3 {
            let (a, b) = ((p + 1) % 3, (p + 2) % 3);
            let expected = w[a] / total * w[b] / (total - w[a]) + w[b] / total * w[a] / (total - w[b]);
            assert!((left_out[p] - expected).abs() < 0.0125, "{left_out:?}, {expected}");
        }
    }

    #[test]
    fn views_and_rounds_are_drawn_apart() {
        let losses = [0.5; 1000];
        let sets: Vec<Vec<u32>> = [(0, 1), (1, 1), (0, 2)]
            .map(|(view, round)| screen_draw(Draw { seed: 7, view, round }, &losses, 100))
            .to_vec();
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            // 10 expected in common, standard deviation 2.9.
            assert!(sets[a].iter().filter(|p| sets[b].contains(p)).count() < 25);
        }
    }
}

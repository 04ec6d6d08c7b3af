//! Twin of `screen_backward.comp`: gradients of 2D Gaussians from gradient records, and their Adam step
//! (method, section 3).
//!
//! One iteration is one thread of the kernel.

use std::f64::consts::PI;

use super::adam::{BETA1, BETA2, EPSILON};
use super::blend_backward::Record;
use super::screen_project::{ANGLE, COLOR, LOG_SCALE, LOGIT, ScreenGaussian, Shape};
use super::{DILATION, Intersections, sigmoid};

/// ∂loss/∂gaussian 0..8.
pub type ScreenGrad = [f64; 9];

/// Learning rate of the centre, multiplied by the mean of width and height (method, section 3).
pub const RATE_CENTRE: f64 = 0.001;
/// Learning rate of the color.
pub const RATE_COLOR: f64 = 0.01;
/// Learning rate of the opacity's logit.
pub const RATE_LOGIT: f64 = 0.02;
/// Learning rate of the log scales.
pub const RATE_LOG_SCALE: f64 = 0.001;
/// Learning rate of the angle.
pub const RATE_ANGLE: f64 = 0.02;
/// Smallest standard deviation of a new Gaussian, pixels; see `glsl/shared/screen.glsl` for the reason.
pub const FIRST_SCALE_MIN: f64 = 0.6;

/// Largest standard deviation in an image of that size, pixels.
pub fn scale_max(width: f64, height: f64) -> f64 {
    (0.01 * (width + height)).clamp(2.0 * FIRST_SCALE_MIN, 50.0)
}

/// Gradients from the blend's records. `tile_counts` and `isects` are the forward pass's, `isect_grads` the
/// blend's, by slot.
pub fn screen_backward(
    gaussians: &[ScreenGaussian],
    tile_counts: &[u32],
    isects: &Intersections,
    isect_grads: &[Record],
) -> Vec<ScreenGrad> {
    (0..gaussians.len())
        .map(|i| {
            let gaussian = &gaussians[i];
            let mut record = [0.0; 9];
            let first = isects.first_slot[i] as usize;
            for slot_record in &isect_grads[first..first + tile_counts[i] as usize] {
                for (sum, part) in record.iter_mut().zip(slot_record) {
                    *sum += part;
                }
            }
            let [wu, wv, d_opacity, uu, uv, vv, d_r, d_g, d_b] = record;
            let e = Shape::new([gaussian[LOG_SCALE], gaussian[LOG_SCALE + 1]], gaussian[ANGLE]);
            let sigma = sigmoid(gaussian[LOGIT]);
            // L times the axes of S, and W = Σ g wwᵀ times those: see the kernel.
            let p = [e.l11 * e.cosine + e.l12 * e.sine, e.l22 * e.sine];
            let q = [e.l12 * e.cosine - e.l11 * e.sine, e.l22 * e.cosine];
            let apply = |x: [f64; 2]| [uu * x[0] + uv * x[1], uv * x[0] + vv * x[1]];
            let dot = |x: [f64; 2], y: [f64; 2]| x[0] * y[0] + x[1] * y[1];
            let growth = e.variance.map(|v| d_opacity * sigma * e.compensation * DILATION / (v + DILATION));
            [
                e.l11 * wu,
                e.l12 * wu + e.l22 * wv,
                d_r,
                d_g,
                d_b,
                d_opacity * e.compensation * sigma * sigmoid(-gaussian[LOGIT]),
                e.variance[0] * dot(p, apply(p)) + growth[0],
                e.variance[1] * dot(q, apply(q)) + growth[1],
                (e.variance[0] - e.variance[1]) * dot(p, apply(q)),
            ]
        })
        .collect()
}

/// Adam's state of a 2D Gaussian.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ScreenMoments {
    /// Mean of the gradients.
    pub first: ScreenGrad,
    /// Mean of their squares.
    pub second: ScreenGrad,
    /// Steps since the Gaussian was drawn.
    pub age: u32,
}

/// Steps every Gaussian that has a finite gradient.
pub fn screen_step(
    gaussians: &mut [ScreenGaussian],
    grads: &[ScreenGrad],
    moments: &mut [ScreenMoments],
    width: u32,
    height: u32,
) {
    let (width, height) = (width as f64, height as f64);
    let log_scale_max = scale_max(width, height).ln();
    for ((gaussian, grad), state) in gaussians.iter_mut().zip(grads).zip(moments) {
        if !grad.iter().all(|g| g.is_finite()) {
            continue;
        }
        state.age += 1;
        let correct1 = 1.0 - BETA1.powf(state.age as f64);
        let correct2 = 1.0 - BETA2.powf(state.age as f64);
        for (p, &g) in grad.iter().enumerate() {
            let (rate, low, high) = match p {
                0 => (RATE_CENTRE * 0.5 * (width + height), 0.0, width),
                1 => (RATE_CENTRE * 0.5 * (width + height), 0.0, height),
                COLOR..LOGIT => (RATE_COLOR, 0.0, 1.0),
                LOGIT => (RATE_LOGIT, f64::MIN, f64::MAX),
                LOG_SCALE..ANGLE => (RATE_LOG_SCALE, f64::MIN, log_scale_max),
                _ => (RATE_ANGLE, f64::MIN, f64::MAX),
            };
            let m = BETA1 * state.first[p] + (1.0 - BETA1) * g;
            let v = BETA2 * state.second[p] + (1.0 - BETA2) * g * g;
            state.first[p] = m;
            state.second[p] = v;
            let mut moved = gaussian[p] - rate * (m / correct1) / ((v / correct2).sqrt() + EPSILON);
            if p == ANGLE {
                moved -= PI * (moved / PI).round();
            }
            gaussian[p] = moved.clamp(low, high);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::reference::{
        Background, Options,
        blend::{Blended, blend},
        blend_backward::blend_backward,
        project::Projected,
        screen_project::screen_project,
        tiles::Tiling,
    };

    const SIZE: [u32; 2] = [37, 29];

    /// Random Gaussians from needles under a pixel to a fifth of the image, some without a depth.
    fn scene(rng: &mut ChaCha8Rng, count: usize) -> (Vec<ScreenGaussian>, Vec<f64>, Vec<[f64; 3]>) {
        let pixels = (SIZE[0] * SIZE[1]) as usize;
        let gaussians = (0..count)
            .map(|_| {
                let mut gaussian = [0.0; 10];
                gaussian[0] = rng.random_range(0.0..SIZE[0] as f64);
                gaussian[1] = rng.random_range(0.0..SIZE[1] as f64);
                for c in 0..3 {
                    gaussian[COLOR + c] = rng.random_range(0.0..1.0);
                }
                gaussian[LOGIT] = rng.random_range(-3.0..3.0);
                gaussian[LOG_SCALE] = rng.random_range(-1.0..2.0);
                gaussian[LOG_SCALE + 1] = rng.random_range(-1.0..2.0);
                gaussian[ANGLE] = rng.random_range(-1.5..1.5);
                gaussian
            })
            .collect();
        // One depth per pixel, all different: the order of two Gaussians never depends on rounding.
        let depths = (0..pixels).map(|_| if rng.random_bool(0.1) { 0.0 } else { rng.random_range(1.0..9.0) }).collect();
        let backdrop = (0..pixels).map(|_| [0; 3].map(|_| rng.random_range(0.0..1.0))).collect();
        (gaussians, depths, backdrop)
    }

    fn forward(
        gaussians: &[ScreenGaussian],
        depths: &[f64],
        backdrop: &[[f64; 3]],
    ) -> (Projected, Intersections, Blended) {
        let options = Options { tile_width: 8, tile_height: 8, ..Default::default() };
        let projected = screen_project(&mut gaussians.to_vec(), depths, SIZE[0], SIZE[1], &options);
        let tiling = Tiling::new(SIZE[0], SIZE[1], &options);
        let isects = Intersections::new(&projected, tiling);
        let blended = blend(&projected.splats, &isects, Background::Image(backdrop), 0.5);
        (projected, isects, blended)
    }

    #[test]
    fn the_gradient_is_the_central_difference_through_blend_and_compensation() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (mut checked, mut skipped) = (0, 0);
        for _ in 0..40 {
            let (gaussians, depths, backdrop) = scene(&mut rng, 12);
            let pull: Vec<[f64; 3]> = backdrop.iter().map(|_| [0; 3].map(|_| rng.random_range(-1.0..1.0))).collect();
            let loss = |blended: &Blended| -> f64 {
                blended.image.iter().zip(&pull).map(|(x, g)| x[0] * g[0] + x[1] * g[1] + x[2] * g[2]).sum()
            };
            let (projected, isects, blended) = forward(&gaussians, &depths, &backdrop);
            let isect_grads = blend_backward(&projected.splats, &isects, &blended.image, &pull);
            let grads = screen_backward(&gaussians, &projected.tile_counts, &isects, &isect_grads);
            for i in 0..gaussians.len() {
                for p in 0..9 {
                    // Truncation ~ step² and rounding ~ 1e-15 / step are near 1e-10 of sums of order 1 to 100.
                    let step = 1e-5;
                    let at = |offset: f64| {
                        let mut moved = gaussians.clone();
                        moved[i][p] += offset;
                        forward(&moved, &depths, &backdrop).2
                    };
                    let (below, above) = (at(-step), at(step));
                    // A pixel came or went (α at 1/255), or a depth changed: no derivative here.
                    if below.decisions != blended.decisions || above.decisions != blended.decisions {
                        skipped += 1;
                        continue;
                    }
                    let difference = (loss(&above) - loss(&below)) / (2.0 * step);
                    let error = (difference - grads[i][p]).abs();
                    assert!(error < 1e-6 * (1.0 + difference.abs()), "gaussian {p}: {difference} for {}", grads[i][p]);
                    checked += 1;
                }
            }
        }
        assert!(checked > 20 * skipped && checked > 3000, "{checked} checked, {skipped} skipped");
    }
}

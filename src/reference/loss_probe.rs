//! Twin of `loss_probe.comp`: random gradients whose squares estimate the loss's curvature.

use super::{
    hash::pcg4d,
    ssim_forward::{SSIM_WEIGHT, counts, target_channel},
};

/// Smallest difference between render and photograph in the weight of a probe.
pub const LEAST_DIFFERENCE: f64 = 0.01;

/// Counter of the hash, different from those of density control.
const HASH_PROBE: u32 = 5;

/// A gradient by RGB of each pixel of frame `frame`, row by row, with new random signs in each `step`.
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

#[cfg(test)]
mod tests {
    use super::super::{Background, Options, Params, View, random_camera, random_scene, render};
    use super::*;
    use crate::scene::layout::{LOG_SCALE, MEAN, OPACITY};

    /// J by central differences of the render, W from the render and the photograph: independent of the backward pass and of the draw.
    #[test]
    fn probes_tell_the_diagonal_of_the_curvature() {
        let (camera, options) = (random_camera(20, 16), Options::default());
        let view = View::from_camera(&camera);
        let params = Params::from_scene(&random_scene(11, 16, 0, 0)).unwrap();
        let black = Background::Color([0.0; 3]);
        let shown = |params: &Params| render(params, &view, &options, black);
        let image: Vec<[f64; 4]> = shown(&params).blended.image.clone();
        // Half of the pixels are far from the photograph, one in eleven does not count.
        let target =
            |i: usize| u32::from(!i.is_multiple_of(11)) << 31 | if i.is_multiple_of(2) { 0x60_4020 } else { 0 };
        let targets: Vec<u32> = (0..image.len()).map(target).collect();
        let mut mean = vec![0.0; params.geometry.len()];
        const DRAWS: u32 = 600;
        for step in 0..DRAWS {
            let probe = loss_probe(&image, &targets, 3, step);
            let grads = shown(&params).backward(&params, &view, &options, &probe).params.geometry;
            mean.iter_mut().zip(grads).for_each(|(mean, g)| *mean += g * g / f64::from(DRAWS));
        }
        let scale = (1.0 - SSIM_WEIGHT) / (3.0 * image.len() as f64);
        let mut told = 0;
        for plane in [MEAN, LOG_SCALE, OPACITY] {
            for i in 0..params.count {
                let at = plane * params.stride + i;
                let moved = |by: f64| {
                    let mut other = params.clone();
                    other.geometry[at] += by;
                    shown(&other).blended.image.clone()
                };
                let (high, low) = (moved(1e-5), moved(-1e-5));
                let mut want = 0.0;
                for (pixel, (high, low)) in high.iter().zip(low).enumerate().filter(|(p, _)| counts(targets[*p])) {
                    for c in 0..3 {
                        let difference =
                            (image[pixel][c] - target_channel(targets[pixel], c)).abs().max(LEAST_DIFFERENCE);
                        want += ((high[c] - low[c]) / 2e-5).powi(2) * scale / difference;
                    }
                }
                // The mean over n squares of a normal number scatters by √(2/n), 6 %: four deviations.
                // Thresholds of α make the differences of some pixels wrong, by less than that. Invisible
                // parameters are 0 in both, up to rounding.
                assert!((mean[at] - want).abs() <= 0.24 * want + 1e-12, "{plane} {i}: {} and {want}", mean[at]);
                told += usize::from(want > 1e-9);
            }
        }
        assert!(told >= 20, "{told} of 48 are seen");
    }
}

//! Twin of `density_weigh.comp`: decides which Gaussians stay, and how likely each is to be drawn.

use super::{
    FLOAT_MAX, Params,
    hash::{pcg4d, uniform},
    sigmoid,
};
use crate::stages::constants::density::{ADC, ERROR, HASH_KEY, MCMC, PULL, SEEN};

/// Range of scores that have a key.
const SCORES: std::ops::RangeInclusive<f64> = 1e-18..=1e18;

/// Parameters of all weights; see `glsl/density/density_weigh.comp`.
#[derive(Debug, Clone, Copy)]
pub struct Weigh {
    /// The strategy's number in `glsl/shared/density.glsl`.
    pub strategy: u32,
    /// Maximum number of Gaussians: MCMC's weights add up to less than 2^32.
    pub capacity: u32,
    /// Gaussians with less opacity are pruned.
    pub least_opacity: f64,
    /// Smallest score at which ADC grows a Gaussian, see `density::LEAST_PULL`.
    pub least_score: f64,
    /// The run's step; with `seed` it determines the keys.
    pub step: u32,
    /// See `step`.
    pub seed: u32,
}

/// Decides whether Gaussian i, `number` of its segment, stays, and its key: a weight for MCMC; else none if
/// it cannot be drawn.
pub fn density_weigh(w: &Weigh, params: &Params, i: usize, number: u32, scores: [f64; 4]) -> (bool, Option<f64>) {
    let opacity = sigmoid(params.logit(i));
    let sized = params.log_scale(i).to_array().iter().all(|s| s.abs() <= FLOAT_MAX);
    let stays = sized && if w.strategy == MCMC { opacity > w.least_opacity } else { opacity >= w.least_opacity };
    let key = match w.strategy {
        MCMC if stays => Some((opacity * f64::from(u32::MAX / w.capacity.max(1) / 2)).floor()),
        MCMC => Some(0.0),
        _ if !stays => None,
        ADC => {
            let (seen, pull) = (scores[SEEN as usize], scores[PULL as usize]);
            (seen > 0.0 && pull / seen >= w.least_score).then_some(0.0)
        }
        _ => {
            let score = scores[ERROR as usize];
            let h = pcg4d([number, w.step, HASH_KEY, w.seed]);
            SCORES.contains(&score).then(|| -(-uniform(h[0])).ln_1p() / score)
        }
    };
    (stays, key)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{reference::random_scene, stages::constants::density::BUDGET};

    /// A Gaussian with three times the score of another has the smaller key in three of four draws.
    #[test]
    fn the_smallest_key_is_drawn_in_proportion_to_the_score() {
        let params = Params::from_scene(&random_scene(5, 2, 0, 0)).unwrap();
        let first = |step: u32| {
            let w = Weigh { strategy: BUDGET, capacity: 10, least_opacity: 0.0, least_score: 2e-4, step, seed: 4 };
            let key = |i: usize, score: f64| density_weigh(&w, &params, i, i as u32, [score, 0.0, 0.0, 0.0]).1;
            key(0, 3.0).unwrap() < key(1, 1.0).unwrap()
        };
        let share = (0..4000).filter(|&step| first(step)).count() as f64 / 4000.0;
        // Five deviations of √(3/16/4000).
        assert!((share - 0.75).abs() < 0.035, "{share}");
    }
}

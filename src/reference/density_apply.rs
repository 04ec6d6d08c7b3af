//! Twin of `density_apply.comp`: turns copies into parents and children, and resets opacities.

use glam::{DQuat, DVec3};

use super::{
    hash::{normal, pcg4d},
    sigmoid,
};
use crate::stages::constants::density::{ADC, HASH_SPLIT, MCMC};

/// Maximum number of copies of a Gaussian, itself included.
pub const COPIES: u32 = 51;
/// Range of the copies' opacities.
pub const OPACITY_RANGE: (f64, f64) = (0.005, 1.0 - 1.0 / 8388608.0);
/// Divisor of both scales if ADC splits.
pub const SPLIT_SCALE: f64 = 1.6;
/// Factor of the longest axis if the budget strategy splits.
pub const HALF_SCALE: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Exponent of the transmittance if the budget strategy splits.
pub const HALF_OPACITY: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Parameters for all Gaussians.
#[derive(Debug, Clone, Copy)]
pub struct Apply {
    /// The strategy's number in `glsl/shared/density.glsl`.
    pub strategy: u32,
    /// Largest scale that ADC clones.
    pub small: f64,
    /// Largest opacity if a reset is due, else 1.
    pub most: f64,
    /// The run's step; with `seed` it determines the random offsets.
    pub step: u32,
    /// See `step`.
    pub seed: u32,
}

/// A Gaussian's geometry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    /// Scene units.
    pub mean: DVec3,
    /// Natural logarithms of the standard deviations, scene units.
    pub log_scale: DVec3,
    /// w, x, y, z, of any length.
    pub quat: [f64; 4],
    /// ln(o / (1 − o)).
    pub logit: f64,
}

/// The moments of a Gaussian that restart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Begins {
    /// All restart at 0.
    pub all: bool,
    /// The opacity's restart at 0.
    pub opacity: bool,
}

/// Opacity and scale factor of `n` Gaussians that replace one (Kheradmand 2024): o' = 1 − (1 − o)^{1/n} and
/// o / Σ_{i=1..n} Σ_{k=0..i−1} C(i−1, k) (−1)^k o'^{k+1} / √(k+1).
pub fn share(opacity: f64, rest: f64, n: u32) -> (f64, f64) {
    let shared = (1.0 - rest.powf(1.0 / f64::from(n))).clamp(OPACITY_RANGE.0, OPACITY_RANGE.1);
    let mut sum = 0.0;
    for i in 1..=n {
        let mut binomial = 1.0;
        for k in 0..i {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            sum += binomial * sign * shared.powi(k as i32 + 1) / f64::from(k + 1).sqrt();
            binomial *= f64::from(i - 1 - k) / f64::from(k + 1);
        }
    }
    (shared, opacity / sum.max(shared))
}

/// Computes the Gaussian of new number `number`; its parent has `copies` children.
pub fn density_apply(apply: &Apply, old: &Geometry, number: u32, copies: u32, child: bool) -> (Geometry, Begins) {
    let mut new = *old;
    let (opacity, rest) = (sigmoid(old.logit), sigmoid(-old.logit));
    let mut fresh = copies > 0;
    let [w, x, y, z] = old.quat;
    let axis = |c: usize| DQuat::from_xyzw(x, y, z, w).normalize() * DVec3::AXES[c];
    if copies > 0 && apply.strategy == MCMC {
        let (shared, factor) = share(opacity, rest, (copies + 1).min(COPIES));
        new.log_scale += factor.ln();
        new.logit = (shared / (1.0 - shared)).ln();
    } else if copies > 0 && apply.strategy == ADC {
        if old.log_scale.max_element() <= apply.small.ln() {
            fresh = child;
        } else {
            let e = normal(pcg4d([number, apply.step, HASH_SPLIT, apply.seed]));
            new.mean += (0..3).map(|c| axis(c) * old.log_scale[c].exp() * e[c]).sum::<DVec3>();
            new.log_scale -= SPLIT_SCALE.ln();
        }
    } else if copies > 0 {
        let s = old.log_scale;
        let longest = (0..3).find(|&c| s[c] == s.max_element()).unwrap_or(2);
        let length = s[longest].exp() * (1.0 - HALF_SCALE * HALF_SCALE).sqrt();
        new.mean += axis(longest) * if child { length } else { -length };
        for c in 0..3 {
            let ratio = (2.0 * (s[c] - s[longest])).exp();
            new.log_scale[c] += (1.0 - ratio * (1.0 - HALF_SCALE)).ln();
        }
        let left = rest.powf(HALF_OPACITY);
        let half = (1.0 - left).clamp(OPACITY_RANGE.0, OPACITY_RANGE.1);
        new.logit = half.ln() - left.max(1.0 - OPACITY_RANGE.1).ln();
    }
    let lowered = sigmoid(new.logit) > apply.most;
    if lowered {
        new.logit = apply.most.ln() - (1.0 - apply.most).ln();
    }
    (new, Begins { all: fresh, opacity: fresh || lowered })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::constants::density::BUDGET;

    const OLD: Geometry = Geometry {
        mean: DVec3::new(1.0, 2.0, 3.0),
        log_scale: DVec3::new(-3.0, -1.0, -2.0),
        quat: [2.0, 0.0, 0.0, 0.0],
        logit: 0.0,
    };

    fn apply(strategy: u32) -> Apply {
        Apply { strategy, small: 1e-3, most: 1.0, step: 1, seed: 2 }
    }

    #[test]
    fn what_has_no_child_stays_and_only_limits_lower_it() {
        for strategy in [MCMC, ADC, BUDGET] {
            let (new, begins) = density_apply(&apply(strategy), &OLD, 5, 0, false);
            assert_eq!((new, begins.all, begins.opacity), (OLD, false, false));
            let reset = Apply { most: 0.01, ..apply(strategy) };
            let (new, begins) = density_apply(&reset, &OLD, 5, 0, false);
            assert!((sigmoid(new.logit) - 0.01).abs() < 1e-12 && begins == Begins { all: false, opacity: true });
        }
    }

    /// n copies have the original's transmittance, exactly so along the ray through their centre.
    #[test]
    fn mcmc_copies_let_through_what_the_one_did() {
        for (n, opacity) in [(2u32, 0.3), (3, 0.9), (7, 0.6), (COPIES, 0.95)] {
            let (shared, factor) = share(opacity, 1.0 - opacity, n);
            assert!(((1.0 - shared).powi(n as i32) - (1.0 - opacity)).abs() < 1e-12, "{n}");
            // The opacity of n such Gaussians, integrated along a line through the centre, equals that of the
            // one. Both are smooth, so the sum is practically exact.
            let hidden = |opacity: f64, scale: f64, n: i32| {
                let at = |i: i32| 1.0 - (1.0 - opacity * (-0.5 * (f64::from(i) * 0.02 / scale).powi(2)).exp()).powi(n);
                (-1000..=1000).map(at).sum::<f64>() * 0.02
            };
            let [one, many] = [hidden(opacity, 1.0, 1), hidden(shared, factor, n as i32)];
            assert!((many / one - 1.0).abs() < 1e-6, "{n} of {opacity}: {one} and {many}");
        }
    }

    #[test]
    fn a_split_keeps_the_mean_and_the_second_moment_along_its_axis() {
        let halves = [false, true].map(|child| density_apply(&apply(BUDGET), &OLD, 5, 1, child).0);
        let middle = (halves[0].mean + halves[1].mean) / 2.0;
        assert!((middle - OLD.mean).length() < 1e-12 && halves[0].mean.y < halves[1].mean.y);
        let half = halves[0].log_scale.y.exp();
        let moment = half * half + (halves[0].mean.y - middle.y).powi(2);
        assert!((moment - (2.0 * OLD.log_scale.y).exp()).abs() < 1e-12);
        assert!(halves[0].log_scale.x < OLD.log_scale.x && halves[0].logit < OLD.logit);
    }

    #[test]
    fn adc_clones_what_is_small_and_splits_the_rest() {
        let clone = Apply { small: 1.0, ..apply(ADC) };
        assert_eq!(density_apply(&clone, &OLD, 5, 1, false), (OLD, Begins { all: false, opacity: false }));
        assert_eq!(density_apply(&clone, &OLD, 6, 1, true), (OLD, Begins { all: true, opacity: true }));
        let [a, b] = [5, 6].map(|number| density_apply(&apply(ADC), &OLD, number, 1, number == 6).0);
        assert!(a.mean != b.mean && ((a.log_scale.y - OLD.log_scale.y).exp() * 1.6 - 1.0).abs() < 1e-12);
        assert_eq!((a.log_scale, a.logit), (b.log_scale, OLD.logit));
    }
}

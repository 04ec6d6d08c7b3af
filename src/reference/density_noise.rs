//! Twin of `density_noise.comp`: noise of means (Kheradmand 2024).

use glam::{DQuat, DVec3};

use super::{
    FLOAT_MAX,
    density_apply::Geometry,
    hash::{normal, pcg4d},
    sigmoid,
};
use crate::stages::constants::density::HASH_NOISE;

/// Steepness and middle of the gate, in transmittance.
pub const GATE: (f64, f64) = (100.0, 0.995);

/// Σ (ε σ(100 ((1 − o) − 0.995))) rate, 0 if that is not finite.
pub fn density_noise(gaussian: &Geometry, rate: f64, number: u32, step: u32, seed: u32) -> DVec3 {
    if !gaussian.logit.is_finite() {
        return DVec3::ZERO;
    }
    let gate = rate * sigmoid(GATE.0 * (1.0 - sigmoid(gaussian.logit) - GATE.1));
    let [w, x, y, z] = gaussian.quat;
    let rotation = DQuat::from_xyzw(x, y, z, w).normalize();
    let e = rotation.inverse() * normal(pcg4d([number, step, HASH_NOISE, seed]));
    let off = rotation * ((2.0 * gaussian.log_scale).exp() * e) * gate;
    if off.abs().max_element() <= FLOAT_MAX { off } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_faint_moves() {
        let faint = Geometry { mean: DVec3::ONE, log_scale: DVec3::splat(-2.0), quat: [1.0; 4], logit: -7.0 };
        let length = |g: Geometry| density_noise(&g, 1.0, 3, 4, 5).length();
        assert!(length(faint) > 1e-4 && length(Geometry { logit: 2.0, ..faint }) < 1e-20);
        assert_ne!(density_noise(&faint, 1.0, 3, 4, 5), density_noise(&faint, 1.0, 3, 5, 5));
        // Σ of a ball is its squared scale, so that twice the scale is four times the noise.
        let twice = Geometry { log_scale: DVec3::splat(-2.0 + 2f64.ln()), ..faint };
        assert!((length(twice) / length(faint) - 4.0).abs() < 1e-9);
    }
}

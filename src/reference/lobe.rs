//! The opacity lobe of supplementary Gaussians (method, section 1).
//!
//! With v the unit vector from the Gaussian to the eye, θ the angle between d and v and ψ = θ/T, the factor
//! is f = cos(ψ/2)^(2 e^β) for ψ < π and exactly 0 beyond.

use std::f64::consts::PI;

use glam::DVec3;

use super::{FLOAT_MAX, FLOAT_MIN};

/// The factor in [0, 1]. 0 if d is 0 (no direction) or anything is NaN.
pub fn factor(direction: DVec3, width: f64, sharpness: f64, to_eye: DVec3) -> f64 {
    match half_angle(direction, width, to_eye) {
        Some(half) => (2.0 * sharpness.exp() * half.cos().ln()).exp(),
        None => 0.0,
    }
}

/// ∂f/∂(d, T, β, mean).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gradient {
    /// By d, of any length.
    pub direction: DVec3,
    /// By T.
    pub width: f64,
    /// By β.
    pub sharpness: f64,
    /// Through v = unit(eye − mean), 1/scene unit.
    pub mean: DVec3,
}

/// The factor's gradient; all 0 if the factor is 0.
///
/// ∂f/∂ψ = −f e^β tan(ψ/2), ∂θ/∂d = −(v − cos θ d̂) / (|d| sin θ), ∂θ/∂v = −(d̂ − cos θ v) / sin θ.
/// tan(ψ/2) / sin θ tends to 1/(2T) as θ → 0, and the vectors it multiplies vanish there.
pub fn factor_gradient(direction: DVec3, width: f64, sharpness: f64, to_eye: DVec3) -> Gradient {
    let Some(half) = half_angle(direction, width, to_eye) else { return Gradient::default() };
    let f = factor(direction, width, sharpness, to_eye);
    if f == 0.0 {
        // cos(ψ/2)^(2e^β) underflowed: f · tan(ψ/2) is 0 for any tangent.
        return Gradient::default();
    }
    let (length, distance) = (direction.length(), to_eye.length());
    let (d, v) = (direction / length, to_eye / distance);
    let (cos, sin) = (d.dot(v), d.cross(v).length());
    let tan = half.tan();
    let quotient = if sin > 0.0 { tan / sin } else { 0.5 / width };
    let steepness = f * sharpness.exp() / width;
    Gradient {
        direction: (v - cos * d) * (steepness * quotient / length),
        width: steepness * tan * (2.0 * half),
        sharpness: f * 2.0 * sharpness.exp() * half.cos().ln(),
        mean: (d - cos * v) * (-steepness * quotient / distance),
    }
}

/// ψ/2, none outside the support. The angle comes from atan2 since acos loses half its digits near 0.
fn half_angle(direction: DVec3, width: f64, to_eye: DVec3) -> Option<f64> {
    let largest = direction.abs().max_element();
    if !(FLOAT_MIN..=FLOAT_MAX).contains(&largest) {
        return None;
    }
    let theta = direction.cross(to_eye).length().atan2(direction.dot(to_eye));
    let psi = theta / width;
    if !(psi < PI) {
        return None;
    }
    Some(0.5 * psi)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The method's own formula, ((cos ψ + 1)/2)^exp(β).
    #[test]
    fn the_factor_is_the_methods() {
        for (angle, width, beta) in [(0.0, 0.5, 0.0), (0.3, 0.4, 1.0), (1.2, 1.0, -2.0), (2.9, 0.95, 0.5)] {
            let to_eye = DVec3::new(f64::sin(angle), 0.0, f64::cos(angle));
            let expected = ((f64::cos(angle / width) + 1.0) / 2.0).powf(f64::exp(beta));
            let found = factor(2.0 * DVec3::Z, width, beta, 5.0 * to_eye);
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}

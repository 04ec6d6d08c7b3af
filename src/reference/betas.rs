//! Twin of `glsl/shared/betas.glsl`: color by spherical betas (Liu et al. 2025).

use std::f64::consts::LN_2;

use glam::DVec3;

use super::Params;
use crate::{scene::color::BETA_LOBES, stages::constants::betas};

/// Range of b (method, section 1); see the kernels.
pub const B_RANGE: (f64, f64) = (betas::BETA_MIN as f64, betas::BETA_MAX as f64);

/// A lobe's light and factor toward a direction, with their derivatives.
pub struct Beta {
    /// Softplus of its color, and the derivative of that.
    pub light: [f64; 3],
    slope: [f64; 3],
    axis: DVec3,
    /// max(0, μ · v) to the power of 4 exp(b).
    pub factor: f64,
    by_cosine: f64,
    /// ∂factor by θ, φ and b.
    by_shape: [f64; 3],
}

/// Evaluates the lobe of this color (before its softplus) and shape toward `v`, a unit vector.
pub fn beta(v: DVec3, color: [f64; 3], [theta, phi, b]: [f64; 3]) -> Beta {
    let steepness = 10.0 * LN_2;
    let axis = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
    let mut beta = Beta {
        light: color.map(|x: f64| x.max(0.0) + (-steepness * x.abs()).exp().ln_1p() / steepness),
        slope: color.map(|x| 1.0 / (1.0 + (-steepness * x).exp())),
        axis,
        factor: 0.0,
        by_cosine: 0.0,
        by_shape: [0.0; 3],
    };
    let cosine = axis.dot(v).min(1.0);
    if cosine > 0.0 {
        let exponent = 4.0 * b.clamp(B_RANGE.0, B_RANGE.1).exp();
        beta.factor = cosine.powf(exponent);
        beta.by_cosine = exponent * cosine.powf(exponent - 1.0);
        let by_theta = DVec3::new(theta.cos() * phi.cos(), theta.cos() * phi.sin(), -theta.sin());
        let by_phi = DVec3::new(-theta.sin() * phi.sin(), theta.sin() * phi.cos(), 0.0);
        let by_b = exponent * cosine.ln() * beta.factor;
        beta.by_shape = [beta.by_cosine * by_theta.dot(v), beta.by_cosine * by_phi.dot(v), by_b];
    }
    beta
}

/// The lobes of Gaussian i. `direction` is the unit vector from the eye to it.
pub fn lobes(params: &Params, i: usize, direction: DVec3) -> impl Iterator<Item = Beta> + '_ {
    let of = move |m| beta(direction, params.coefficient(i, 1 + 2 * m), params.coefficient(i, 2 + 2 * m));
    (0..BETA_LOBES).map(of)
}

/// Writes the gradients of the lobes' numbers to `out` and returns that of the direction, not yet made tangent to the sphere.
pub fn backward(params: &Params, i: usize, direction: DVec3, color_grad: [f64; 3], out: &mut Params) -> DVec3 {
    let mut direction_grad = DVec3::ZERO;
    for (m, lobe) in lobes(params, i, direction).enumerate() {
        let shine = (0..3).map(|c| color_grad[c] * lobe.light[c]).sum::<f64>();
        for (c, grad) in color_grad.into_iter().enumerate() {
            let plane = |k: usize| (3 * k + c) * params.stride + i;
            out.sh[plane(1 + 2 * m)] = lobe.factor * lobe.slope[c] * grad;
            out.sh[plane(2 + 2 * m)] = shine * lobe.by_shape[c];
        }
        direction_grad += shine * lobe.by_cosine * lobe.axis;
    }
    direction_grad
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Behind a lobe there is nothing, along it all its light; with color 0 that is a tenth (DBS's
    /// softplus).
    #[test]
    fn a_lobe_shines_along_its_axis_and_not_behind() {
        let along = beta(DVec3::Z, [0.0, 2.0, -2.0], [0.0, 1.0, 3.0]);
        assert!((along.light[0] - 0.1).abs() < 1e-15 && (along.light[1] - 2.0).abs() < 1e-6 && along.light[2] < 1e-6);
        assert_eq!((along.factor, along.by_shape[0], along.by_shape[2]), (1.0, 0.0, 0.0));
        for behind in [DVec3::X, DVec3::NEG_Z, DVec3::new(0.6, 0.0, -0.8)] {
            let lobe = beta(behind, [1.0; 3], [0.0, 1.0, 3.0]);
            assert_eq!((lobe.factor, lobe.by_cosine, lobe.by_shape), (0.0, 0.0, [0.0; 3]));
        }
        // The sharpest lobe has half its light at a degree, the bluntest is a cosine; b outside the range is
        // clamped.
        let at = |degrees: f64, b: f64| {
            beta(DVec3::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos()), [0.0; 3], [0.0, 0.0, b])
        };
        assert!((at(1.0, 7.0).factor - 0.51).abs() < 0.01 && at(1.0, 9.0).factor == at(1.0, 7.0).factor);
        assert!((at(60.0, -9.0).factor - 0.5).abs() < 1e-6);
    }
}

//! Twin of `glsl/shared/color.glsl`: the color of a Gaussian toward a view, and its gradient. Real
//! spherical harmonics up to degree 3 with the sign convention of 3DGS, in which Y of order m carries (−1)^m,
//! or their constant and betas.

use glam::DVec3;

use super::{
    Params,
    betas::{self, lobes},
};
use crate::scene::{
    color::{self, BETAS},
    layout::coefficients,
};

/// RGB before it is clamped at 0. `direction` is the unit vector from the eye to the Gaussian.
pub fn color_of(params: &Params, i: usize, degree: u32, direction: DVec3) -> [f64; 3] {
    let degree = color::of(params.sh_degree).part(degree);
    let harmonics = if degree == BETAS { 0 } else { degree };
    let mut color = [0.5; 3];
    for (k, y) in basis(harmonics, direction).iter().enumerate().take(coefficients(harmonics)) {
        for (c, coefficient) in params.coefficient(i, k).into_iter().enumerate() {
            color[c] += y * coefficient;
        }
    }
    if degree == BETAS {
        for lobe in lobes(params, i, direction) {
            (0..3).for_each(|c| color[c] += lobe.factor * lobe.light[c]);
        }
    }
    color
}

/// Writes the gradients of the coefficients to `out` and returns that of the direction, not yet made tangent to the sphere.
pub fn color_backward(
    params: &Params,
    i: usize,
    degree: u32,
    direction: DVec3,
    color_grad: [f64; 3],
    out: &mut Params,
) -> DVec3 {
    let degree = color::of(params.sh_degree).part(degree);
    let harmonics = if degree == BETAS { 0 } else { degree };
    let (basis, basis_grad) = (basis(harmonics, direction), basis_gradient(harmonics, direction));
    let mut direction_grad = DVec3::ZERO;
    if degree == BETAS {
        direction_grad += betas::backward(params, i, direction, color_grad, out);
    }
    for k in 0..coefficients(harmonics) {
        let coefficient = params.coefficient(i, k);
        let mut sum = 0.0;
        for c in 0..3 {
            out.sh[(3 * k + c) * params.stride + i] = basis[k] * color_grad[c];
            sum += coefficient[c] * color_grad[c];
        }
        direction_grad += basis_grad[k] * sum;
    }
    direction_grad
}

// √(1/4π), √(3/4π), and so on: the usual orthonormal constants, as in every table of real harmonics.
pub(super) const C0: f64 = 0.28209479177387814;
const C1: f64 = 0.4886025119029199;
const C2: [f64; 3] = [1.0925484305920792, 0.31539156525252005, 0.5462742152960396];
const C3: [f64; 5] = [0.5900435899266435, 2.890611442640554, 0.4570457994644658, 0.3731763325901154, 1.445305721320277];

/// Y_k(direction) of a unit direction; entries beyond (degree + 1)² are 0.
pub fn basis(degree: u32, direction: DVec3) -> [f64; 16] {
    let DVec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let mut b = [0.0; 16];
    b[0] = C0;
    if degree >= 1 {
        b[1] = -C1 * y;
        b[2] = C1 * z;
        b[3] = -C1 * x;
    }
    if degree >= 2 {
        b[4] = C2[0] * x * y;
        b[5] = -C2[0] * y * z;
        b[6] = C2[1] * (2.0 * zz - xx - yy);
        b[7] = -C2[0] * x * z;
        b[8] = C2[2] * (xx - yy);
    }
    if degree >= 3 {
        b[9] = -C3[0] * y * (3.0 * xx - yy);
        b[10] = C3[1] * x * y * z;
        b[11] = -C3[2] * y * (4.0 * zz - xx - yy);
        b[12] = C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
        b[13] = -C3[2] * x * (4.0 * zz - xx - yy);
        b[14] = C3[4] * z * (xx - yy);
        b[15] = -C3[0] * x * (xx - 3.0 * yy);
    }
    b
}

/// ∂Y_k/∂direction of the polynomials above. Their part along the direction has no meaning: the caller
/// removes it when it differentiates the normalisation.
pub fn basis_gradient(degree: u32, direction: DVec3) -> [DVec3; 16] {
    let DVec3 { x, y, z } = direction;
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let mut d = [DVec3::ZERO; 16];
    if degree >= 1 {
        d[1] = -C1 * DVec3::Y;
        d[2] = C1 * DVec3::Z;
        d[3] = -C1 * DVec3::X;
    }
    if degree >= 2 {
        d[4] = C2[0] * DVec3::new(y, x, 0.0);
        d[5] = -C2[0] * DVec3::new(0.0, z, y);
        d[6] = C2[1] * DVec3::new(-2.0 * x, -2.0 * y, 4.0 * z);
        d[7] = -C2[0] * DVec3::new(z, 0.0, x);
        d[8] = C2[2] * DVec3::new(2.0 * x, -2.0 * y, 0.0);
    }
    if degree >= 3 {
        d[9] = -C3[0] * DVec3::new(6.0 * x * y, 3.0 * (xx - yy), 0.0);
        d[10] = C3[1] * DVec3::new(y * z, x * z, x * y);
        d[11] = -C3[2] * DVec3::new(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z);
        d[12] = C3[3] * DVec3::new(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy);
        d[13] = -C3[2] * DVec3::new(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z);
        d[14] = C3[4] * DVec3::new(2.0 * x * z, -2.0 * y * z, xx - yy);
        d[15] = -C3[0] * DVec3::new(3.0 * (xx - yy), -6.0 * x * y, 0.0);
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gauss–Legendre in z would need a table; a midpoint rule in z and φ with 400 × 400 nodes has an error of
    /// order (2/400)² on these polynomials of degree ≤ 6, hence 1e-4.
    #[test]
    fn the_basis_is_orthonormal() {
        let n = 400;
        let mut gram = [[0.0; 16]; 16];
        for i in 0..n {
            let z = (i as f64 + 0.5) / n as f64 * 2.0 - 1.0;
            for j in 0..n {
                let phi = (j as f64 + 0.5) / n as f64 * std::f64::consts::TAU;
                let s = (1.0 - z * z).sqrt();
                let b = basis(3, DVec3::new(s * phi.cos(), s * phi.sin(), z));
                for k in 0..16 {
                    for l in 0..16 {
                        gram[k][l] += b[k] * b[l];
                    }
                }
            }
        }
        let area = 4.0 * std::f64::consts::PI / (n * n) as f64;
        for (k, row) in gram.iter().enumerate() {
            for (l, sum) in row.iter().enumerate() {
                let expected = if k == l { 1.0 } else { 0.0 };
                assert!((sum * area - expected).abs() < 1e-4, "<Y{k}, Y{l}> = {}", sum * area);
            }
        }
    }
}

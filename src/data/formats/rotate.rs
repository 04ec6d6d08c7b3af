//! Transforms Gaussians by a rotation, a uniform scale and a translation.

use std::f64::consts::TAU;

use glam::{DMat3, DMat4, DQuat, DVec3};

use super::axes::{self, Signs};
use crate::data::ply_variants::far_origin;
use crate::scene::{Gaussians, Lobes};

/// Tolerance for the columns of a matrix to be perpendicular and equally long.
const SKEW: f64 = 1e-4;

/// A rotation, then a scale, then a translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placing {
    rotation: DMat3,
    scale: f64,
    shift: DVec3,
}

impl Placing {
    /// `None` if the matrix mirrors, shears, or scales axes differently.
    pub(super) fn of(matrix: DMat4) -> Option<Placing> {
        let linear = DMat3::from_mat4(matrix);
        let scale = linear.determinant().cbrt();
        let rotation = linear * scale.recip();
        let off = rotation.transpose() * rotation - DMat3::IDENTITY;
        let sound = scale.is_finite() && scale > 0.0 && matrix.is_finite();
        (sound && off.to_cols_array().iter().all(|v| v.abs() < SKEW)).then(|| Placing {
            rotation,
            scale,
            shift: matrix.w_axis.truncate(),
        })
    }

    /// Transforms Gaussians and flips their axes. If the first that come are too far away for float32, means are relative to their
    /// place, which becomes `origin`.
    pub(super) fn into_frame(self, gaussians: &mut Gaussians, origin: &mut Option<DVec3>, signs: Signs) {
        let origin = origin.get_or_insert_with(|| {
            let reach = |at: &[f32; 3]| self.scale * DVec3::from_array(at.map(f64::from)).length();
            far_origin(self.shift, gaussians.means.iter().map(reach).collect())
        });
        Placing { shift: self.shift - *origin, ..self }.apply(gaussians);
        axes::flip(gaussians, signs);
    }

    /// Transforms Gaussians; the identity changes no bit.
    pub(super) fn apply(&self, gaussians: &mut Gaussians) {
        if *self == (Placing { rotation: DMat3::IDENTITY, scale: 1.0, shift: DVec3::ZERO }) {
            return;
        }
        let (turn, size) = (DQuat::from_mat3(&self.rotation), self.scale.ln() as f32);
        for mean in &mut gaussians.means {
            let place = self.rotation * DVec3::from_array(mean.map(f64::from)) * self.scale + self.shift;
            *mean = place.as_vec3().to_array();
        }
        gaussians.log_scales.iter_mut().for_each(|scales| *scales = scales.map(|v| v + size));
        for quat in &mut gaussians.quats {
            let [w, x, y, z] = quat.map(f64::from);
            let q = turn * DQuat::from_xyzw(x, y, z, w);
            *quat = [q.w, q.x, q.y, q.z].map(|v| v as f32);
        }
        let bands: Vec<Vec<Vec<f64>>> = (1..=gaussians.sh_degree as usize).map(|l| band(l, &self.rotation)).collect();
        let k = gaussians.sh_coefficients();
        for coefficients in gaussians.sh.chunks_exact_mut(k) {
            for (l, matrix) in (1..).zip(&bands) {
                let begin = l * l;
                let before: Vec<[f32; 3]> = coefficients[begin..begin + matrix.len()].to_vec();
                for (row, rgb) in matrix.iter().zip(&mut coefficients[begin..]) {
                    *rgb = [0, 1, 2].map(|channel| {
                        row.iter().zip(&before).map(|(m, c)| m * f64::from(c[channel])).sum::<f64>() as f32
                    });
                }
            }
        }
    }

    /// Rotates lobes; directions have no size.
    pub(super) fn apply_to_lobes(&self, lobes: &mut Lobes) {
        if self.rotation == DMat3::IDENTITY {
            return;
        }
        for direction in &mut lobes.directions {
            *direction = (self.rotation * DVec3::from_array(direction.map(f64::from))).as_vec3().to_array();
        }
    }
}

/// Matrix for the coefficients of degree `l` under a rotation: M_ij = ∫ Y_i(d) Y_j(Rᵀd) dω. The product of
/// Gauss's rule with four nodes in z and eight even steps around z is exact for polynomials up to degree 7,
/// and the integrands have degree 6.
fn band(l: usize, rotation: &DMat3) -> Vec<Vec<f64>> {
    const NODES: [(f64, f64); 2] =
        [(0.861_136_311_594_052_6, 0.347_854_845_137_453_85), (0.339_981_043_584_856_26, 0.652_145_154_862_546_2)];
    let mut out = vec![vec![0.0; 2 * l + 1]; 2 * l + 1];
    for (z, weight) in NODES.into_iter().flat_map(|(z, weight)| [(z, weight), (-z, weight)]) {
        for step in 0..8 {
            let (sine, cosine) = (TAU * (f64::from(step) + 0.5) / 8.0).sin_cos();
            let radius = (1.0 - z * z).sqrt();
            let direction = DVec3::new(radius * cosine, radius * sine, z);
            let (here, there) = (harmonics(direction), harmonics(rotation.transpose() * direction));
            for (i, row) in out.iter_mut().enumerate() {
                for (j, value) in row.iter_mut().enumerate() {
                    *value += weight * TAU / 8.0 * here[l * l + i] * there[l * l + j];
                }
            }
        }
    }
    out
}

/// Real harmonics up to degree 3 at a unit vector, with the signs of 3DGS (Condon and Shortley's phase).
fn harmonics(d: DVec3) -> [f64; 16] {
    let DVec3 { x, y, z } = d;
    let n = |numerator: f64, denominator: f64| (numerator / (denominator * std::f64::consts::PI)).sqrt();
    [
        n(1.0, 4.0),
        -n(3.0, 4.0) * y,
        n(3.0, 4.0) * z,
        -n(3.0, 4.0) * x,
        n(15.0, 4.0) * x * y,
        -n(15.0, 4.0) * y * z,
        n(5.0, 16.0) * (2.0 * z * z - x * x - y * y),
        -n(15.0, 4.0) * x * z,
        n(15.0, 16.0) * (x * x - y * y),
        -n(35.0, 32.0) * y * (3.0 * x * x - y * y),
        n(105.0, 4.0) * x * y * z,
        -n(21.0, 32.0) * y * (4.0 * z * z - x * x - y * y),
        n(7.0, 16.0) * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y),
        -n(21.0, 32.0) * x * (4.0 * z * z - x * x - y * y),
        n(105.0, 16.0) * z * (x * x - y * y),
        -n(35.0, 32.0) * x * (x * x - 3.0 * y * y),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::axes;
    use super::*;
    use crate::reference::random_scene;

    fn value(sh: &[[f32; 3]], direction: DVec3) -> [f64; 3] {
        let basis = harmonics(direction.normalize());
        [0, 1, 2].map(|c| sh.iter().zip(basis).map(|(rgb, y)| f64::from(rgb[c]) * y).sum())
    }

    #[test]
    fn colors_turn_with_the_gaussian() {
        let turn = DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 1.1);
        let matrix = DMat4::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::new(1.0, 2.0, 3.0));
        let before = random_scene(4, 5, 0, 3).base;
        let mut after = before.clone();
        Placing::of(matrix).unwrap().apply(&mut after);
        for i in 0..5 {
            for direction in [DVec3::X, DVec3::new(0.2, -1.0, 0.4), DVec3::new(-1.0, 0.1, -0.7)] {
                let (a, b) = (&before.sh[16 * i..16 * i + 16], &after.sh[16 * i..16 * i + 16]);
                let off = value(a, direction).into_iter().zip(value(b, turn * direction)).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-6);
            }
            let place = matrix.transform_point3(DVec3::from_array(before.means[i].map(f64::from)));
            assert!((place - DVec3::from_array(after.means[i].map(f64::from))).length() < 1e-5);
            assert!((after.log_scales[i][1] - before.log_scales[i][1] - 2f32.ln()).abs() < 1e-6);
        }
    }

    /// Compares with the sign flips of `axes`, another implementation of rotations by 180°.
    #[test]
    fn half_turns_are_changes_of_sign() {
        for (signs, axis) in
            [([1.0, -1.0, -1.0], DVec3::X), ([-1.0, 1.0, -1.0], DVec3::Y), ([-1.0, -1.0, 1.0], DVec3::Z)]
        {
            let mut turned = random_scene(6, 4, 0, 3).base;
            let mut flipped = turned.clone();
            let matrix = DMat4::from_quat(DQuat::from_axis_angle(axis, std::f64::consts::PI));
            Placing::of(matrix).unwrap().apply(&mut turned);
            axes::flip(&mut flipped, signs);
            let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
            assert!(near(turned.means.as_flattened(), flipped.means.as_flattened()));
            assert!(near(turned.sh.as_flattened(), flipped.sh.as_flattened()));
            for (a, b) in turned.quats.iter().zip(&flipped.quats) {
                let matrix = |q: &[f32; 4]| {
                    let [w, x, y, z] = q.map(f64::from);
                    // Rotating a Gaussian by 180° about its own axes does not change it.
                    let frame = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
                    frame * DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0)) * frame.transpose()
                };
                let off = matrix(a) - matrix(b);
                assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-5));
            }
        }
    }

    #[test]
    fn what_is_no_placing_is_none() {
        assert!(Placing::of(DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0))).is_none());
        assert!(Placing::of(DMat4::from_scale(DVec3::new(1.0, 2.0, 1.0))).is_none());
        assert!(Placing::of(DMat4::ZERO).is_none());
        assert!(Placing::of(DMat4::from_translation(DVec3::splat(f64::NAN))).is_none());
    }
}

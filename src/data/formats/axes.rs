//! Flips the signs of axes, for formats with another frame than PLY.
//!
//! All frames have the same three axes up to their signs. Flipping two axes is a rotation by 180° about the
//! third, so it keeps the scene and rounds no number.

use glam::DVec3;

use crate::scene::{Gaussians, Lobes};

/// Factor of each axis: 1 or −1.
pub(super) type Signs = [f32; 3];

/// Between PLY (x right, y down, z front) and SPZ, OpenGL (x right, y up, z back).
pub(super) const Y_UP_Z_BACK: Signs = [1.0, -1.0, -1.0];

/// Whether x, y and z are odd factors of each harmonic up to degree 3, in the order of the coefficients: 1;
/// y, z, x; xy, yz, 3z²−1, xz, x²−y²; y(3x²−y²), xyz, y(5z²−1), z(5z²−3), x(5z²−1), z(x²−y²), x(x²−3y²).
const ODD: [[bool; 3]; 16] = [
    [false, false, false],
    [false, true, false],
    [false, false, true],
    [true, false, false],
    [true, true, false],
    [false, true, true],
    [false, false, false],
    [true, false, true],
    [false, false, false],
    [false, true, false],
    [true, true, true],
    [false, true, false],
    [false, false, true],
    [true, false, false],
    [false, false, true],
    [true, false, false],
];

/// Factor of coefficient `k` of the harmonics.
pub(super) fn of_harmonic(signs: Signs, k: usize) -> f32 {
    (0..3).filter(|&axis| ODD[k][axis]).map(|axis| signs[axis]).product()
}

/// Factors of a quaternion (w, x, y, z): flipping axes y and z keeps the rotation about x.
pub(super) fn of_quaternion([x, y, z]: Signs) -> [f32; 4] {
    [1.0, y * z, x * z, x * y]
}

/// Flips axes. Flipping twice restores them.
pub(super) fn flip(gaussians: &mut Gaussians, signs: Signs) {
    let turn = of_quaternion(signs);
    let k = gaussians.sh_coefficients();
    gaussians.means.iter_mut().for_each(|mean| *mean = std::array::from_fn(|i| mean[i] * signs[i]));
    gaussians.quats.iter_mut().for_each(|quat| *quat = std::array::from_fn(|i| quat[i] * turn[i]));
    for (i, rgb) in gaussians.sh.iter_mut().enumerate() {
        let sign = of_harmonic(signs, i % k);
        *rgb = rgb.map(|v| v * sign);
    }
}

/// Flips an origin's axes; the world's if there is none. Adding 0 avoids −0.
pub(super) fn flip_origin(origin: Option<DVec3>, signs: Signs) -> DVec3 {
    DVec3::from_array(signs.map(f64::from)) * origin.unwrap_or_default() + DVec3::ZERO
}

/// Flips axes of lobes.
pub(super) fn flip_lobes(lobes: &mut Lobes, signs: Signs) {
    lobes.directions.iter_mut().for_each(|d| *d = std::array::from_fn(|i| d[i] * signs[i]));
}

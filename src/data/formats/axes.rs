//! Axes that are turned around, for formats with another frame than PLY.
//!
//! Every frame here has the same three axes up to their signs. Where two axes are turned around this is a rotation by 180° about the
//! third, so a scene stays itself and none of its numbers is rounded.

use crate::scene::{Gaussians, Lobes};

/// What each axis is multiplied by: 1 or −1.
pub(super) type Signs = [f32; 3];

/// Between PLY (x right, y down, z front) and SPZ, OpenGL (x right, y up, z back).
pub(super) const Y_UP_Z_BACK: Signs = [1.0, -1.0, -1.0];

/// How often x, y and z are a factor of each harmonic up to degree 3, modulo 2, in the order of their coefficients: 1; y, z, x; xy, yz,
/// 3z²−1, xz, x²−y²; y(3x²−y²), xyz, y(5z²−1), z(5z²−3), x(5z²−1), z(x²−y²), x(x²−3y²).
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

/// What coefficient `k` of the harmonics is multiplied by.
pub(super) fn of_harmonic(signs: Signs, k: usize) -> f32 {
    (0..3).filter(|&axis| ODD[k][axis]).map(|axis| signs[axis]).product()
}

/// What a quaternion (w, x, y, z) is multiplied by: turning axes y and z around leaves what turns about x as it is.
pub(super) fn of_quaternion([x, y, z]: Signs) -> [f32; 4] {
    [1.0, y * z, x * z, x * y]
}

/// Turns axes around. The inverse is the same once more.
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

/// The same of lobes.
pub(super) fn flip_lobes(lobes: &mut Lobes, signs: Signs) {
    lobes.directions.iter_mut().for_each(|d| *d = std::array::from_fn(|i| d[i] * signs[i]));
}

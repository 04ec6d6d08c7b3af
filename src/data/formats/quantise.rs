//! Conversions between numbers and bytes that several formats share.

use std::f64::consts::FRAC_2_SQRT_PI;

/// The constant harmonic, √(1/4π): a color of 0 to 1 is 0.5 + `C0` times the coefficient.
pub(super) const C0: f64 = FRAC_2_SQRT_PI / 4.0;

/// Stands for the scale 0 of a flat Gaussian, which has no logarithm: the smallest normal float32.
const FLAT: f32 = f32::MIN_POSITIVE;

/// Rounds to 0 to 255; NaN becomes 0.
pub(super) fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// Opacity from its logit, 0 to 1.
pub(super) fn opacity(logit: f32) -> f64 {
    1.0 / (1.0 + (-f64::from(logit)).exp())
}

/// Logit of an opacity. 1 and 0 have none, so the nearest numbers that have one are used. Invalid opacities
/// become NaN, which is later refused as not finite.
pub(super) fn logit(opacity: f32) -> f32 {
    if !(0.0..=1.0).contains(&opacity) {
        return f32::NAN;
    }
    let opacity = f64::from(opacity).clamp(f64::from(f32::MIN_POSITIVE), 1.0 - f64::from(f32::EPSILON) / 4.0);
    (opacity / (1.0 - opacity)).ln() as f32
}

/// Opacity as a byte.
pub(super) fn opacity_byte(logit: f32) -> u8 {
    byte(255.0 * opacity(logit))
}

/// Logit of a byte of opacity. Bytes 0 and 255 stand for 0 to half a step and for 254.5 to 255. The ends have
/// no logit, so the middle of these intervals is used.
pub(super) fn opacity_logit(byte: u8) -> f32 {
    let value = match byte {
        0 => 0.25,
        255 => 254.75,
        byte => f64::from(byte),
    };
    (value / (255.0 - value)).ln() as f32
}

/// Coefficient of a color byte.
pub(super) fn color_coefficient(byte: u8) -> f32 {
    ((f64::from(byte) / 255.0 - 0.5) / C0) as f32
}

/// Color byte of a coefficient; values outside 0 to 1 are clamped.
pub(super) fn color_byte(coefficient: f32) -> u8 {
    byte(255.0 * (0.5 + C0 * f64::from(coefficient)))
}

/// Logarithm of a scale. A negative scale becomes NaN, which is later refused as not finite.
pub(super) fn log_scale(scale: f32) -> f32 {
    if scale == 0.0 { FLAT.ln() } else { scale.ln() }
}

/// Standard deviation to store, clamped to float32's maximum.
pub(super) fn scale(log_scale: f32) -> f32 {
    log_scale.exp().min(f32::MAX)
}

/// Normalises a quaternion in float64; a zero rotation stays unchanged.
pub(super) fn unit(quat: [f32; 4]) -> [f64; 4] {
    let quat = quat.map(f64::from);
    let length = quat.iter().map(|v| v * v).sum::<f64>().sqrt();
    if length > 0.0 { quat.map(|v| v / length) } else { quat }
}

/// Index of the largest component of a rotation, and the other three in order, with the sign that makes the
/// largest positive.
pub(super) fn smallest_three(quat: [f32; 4]) -> (usize, [f64; 3]) {
    let unit = unit(quat);
    let mut largest = 0;
    for i in 1..4 {
        if unit[i].abs() > unit[largest].abs() {
            largest = i;
        }
    }
    let sign = if unit[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut rest = (0..4).filter(|&i| i != largest).map(|i| sign * unit[i]);
    (largest, std::array::from_fn(|_| rest.next().unwrap_or(0.0)))
}

/// The inverse of [`smallest_three`].
pub(super) fn from_smallest_three(largest: usize, three: [f64; 3]) -> [f32; 4] {
    let mut rest = three.into_iter();
    let last = (1.0 - three.iter().map(|v| v * v).sum::<f64>()).max(0.0).sqrt();
    std::array::from_fn(|i| if i == largest { last as f32 } else { rest.next().unwrap_or(0.0) as f32 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_opacity_come_back() {
        for b in 0..=255 {
            assert!(opacity_logit(b).is_finite());
            assert_eq!(opacity_byte(opacity_logit(b)), b);
            assert_eq!(color_byte(color_coefficient(b)), b);
        }
        assert_eq!((opacity_byte(f32::MAX), opacity_byte(f32::MIN), opacity_byte(0.0)), (255, 0, 128));
    }

    #[test]
    fn a_rotation_is_its_three_smaller_components() {
        for quat in [[1.0, 0.0, 0.0, 0.0], [0.1, -0.9, 0.2, 0.3], [-0.2, 0.1, 0.3, -2.0], [0.5, -0.5, 0.5, -0.5]] {
            let (largest, three) = smallest_three(quat);
            assert!(three.iter().all(|v| v.abs() <= 0.5f64.sqrt() + 1e-12));
            let (back, wanted) = (from_smallest_three(largest, three), unit(quat));
            let dot: f64 = back.iter().zip(wanted).map(|(&a, b)| f64::from(a) * b).sum();
            assert!(dot.abs() > 1.0 - 1e-7, "{quat:?} {back:?}");
        }
    }
}

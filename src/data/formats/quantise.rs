//! From numbers to bytes and back, as several formats have it.

use std::f64::consts::FRAC_2_SQRT_PI;

/// The constant harmonic, √(1/4π): a colour of 0 to 1 is 0.5 + `C0` times the coefficient.
pub(super) const C0: f64 = FRAC_2_SQRT_PI / 4.0;

/// What a flat Gaussian's scale of 0 is read as, since it has no logarithm: the least float32 that is not denormal.
const FLAT: f32 = f32::MIN_POSITIVE;

/// The nearest of 0 to 255; NaN is 0.
pub(super) fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// Opacity, 0 to 1.
pub(super) fn opacity(logit: f32) -> f64 {
    1.0 / (1.0 + (-f64::from(logit)).exp())
}

/// The logit of an opacity. 1 and 0 have none: the nearest numbers that do are taken. What is no opacity becomes NaN, which is then
/// refused as a number that is not finite.
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

/// The logit of a byte of opacity. What rounds to 0 lies between 0 and half a step, and to 255 between 254.5 and 255; neither end has
/// a logit, so the middle of that is taken.
pub(super) fn opacity_logit(byte: u8) -> f32 {
    let value = match byte {
        0 => 0.25,
        255 => 254.75,
        byte => f64::from(byte),
    };
    (value / (255.0 - value)).ln() as f32
}

/// A colour's coefficient from its byte.
pub(super) fn colour_coefficient(byte: u8) -> f32 {
    ((f64::from(byte) / 255.0 - 0.5) / C0) as f32
}

/// A colour as a byte; beyond 0 to 1 it is cut off.
pub(super) fn colour_byte(coefficient: f32) -> u8 {
    byte(255.0 * (0.5 + C0 * f64::from(coefficient)))
}

/// The logarithm of a scale. A negative one has none (NaN), which is then refused as a number that is not finite.
pub(super) fn log_scale(scale: f32) -> f32 {
    if scale == 0.0 { FLAT.ln() } else { scale.ln() }
}

/// The standard deviation that is stored; what float32 does not hold is its greatest.
pub(super) fn scale(log_scale: f32) -> f32 {
    log_scale.exp().min(f32::MAX)
}

/// Of length 1, in float64; a zero rotation stays as it is.
pub(super) fn unit(quat: [f32; 4]) -> [f64; 4] {
    let quat = quat.map(f64::from);
    let length = quat.iter().map(|v| v * v).sum::<f64>().sqrt();
    if length > 0.0 { quat.map(|v| v / length) } else { quat }
}

/// A rotation as its three smaller components, in their order, with the sign that makes the largest positive; and which that is.
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
            assert_eq!(colour_byte(colour_coefficient(b)), b);
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

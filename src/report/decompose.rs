//! What of an image is the same from everywhere and what is not (method, section 6), in linear light.

/// Linear light of an sRGB value (IEC 61966-2-1); values above 1 follow the same curve.
pub fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The inverse of [`linear_from_srgb`].
pub fn srgb_from_linear(v: f32) -> f32 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Two images that add up to the whole, linear light, as long as what they were made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Decomposition {
    pub diffuse: Vec<f32>,
    pub specular: Vec<f32>,
}

/// `whole` is an image of everything, `constant` one of the base Gaussians with their constant SH band only; both sRGB values
/// of the same length. Diffuse is the smaller of the two in linear light, specular what the whole has more, never negative.
pub fn decompose(whole: &[f32], constant: &[f32]) -> Decomposition {
    let (diffuse, specular) = whole
        .iter()
        .zip(constant)
        .map(|(&whole, &constant)| {
            let (all, diffuse) = (linear_from_srgb(whole), linear_from_srgb(constant.min(whole)));
            (diffuse, all - diffuse)
        })
        .unzip();
    Decomposition { diffuse, specular }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_srgb_curve_and_its_inverse() {
        // Mid grey of the standard's table, and both ends.
        assert!((linear_from_srgb(0.5) - 0.214_041_14).abs() < 1e-6);
        assert_eq!((linear_from_srgb(0.0), linear_from_srgb(1.0)), (0.0, 1.0));
        for i in 0..=300 {
            let v = i as f32 / 100.0;
            assert!((srgb_from_linear(linear_from_srgb(v)) - v).abs() < 2e-6, "{v}");
        }
    }

    #[test]
    fn parts_add_up_and_are_never_negative() {
        let (whole, constant) = ([0.2, 0.8, 1.7, 0.0], [0.5, 0.3, 0.9, 0.0]);
        let parts = decompose(&whole, &constant);
        for i in 0..4 {
            let all = linear_from_srgb(whole[i]);
            assert!((parts.diffuse[i] + parts.specular[i] - all).abs() <= f32::EPSILON * all);
            assert!(parts.specular[i] >= 0.0 && parts.diffuse[i] <= linear_from_srgb(constant[i]));
        }
        assert_eq!(parts.specular[0], 0.0);
    }
}

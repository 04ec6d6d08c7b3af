//! Twin of `density_image.comp`: per-pixel terms of the Gaussians' scores.

use super::FLOAT_MAX;

/// Mean |difference| of the channels, 1 and 0. All 0 if the pixel does not count (alpha 0 of the packed
/// target) or its error is not finite. `image` is RGB and transmittance.
pub fn density_image(image: &[[f64; 4]], targets: &[u32]) -> Vec<[f64; 3]> {
    let pixel = |(shown, &target): (&[f64; 4], &u32)| {
        let channel = |c: usize| f64::from(target >> (8 * c) & 0xFF) / 255.0;
        let error = (0..3).map(|c| (shown[c] - channel(c)).abs()).sum::<f64>() / 3.0;
        if target >> 24 != 0 && error <= FLOAT_MAX { [error, 1.0, 0.0] } else { [0.0; 3] }
    };
    image.iter().zip(targets).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_do_not_count_or_are_no_number_have_no_part() {
        let image = [[0.5, 0.25, 1.0, 0.0], [1.0; 4], [f64::NAN, 0.0, 0.0, 0.0], [0.0; 4]];
        let found = density_image(&image, &[0xFF00_0000, 0x0000_0000, 0xFF00_0000, 0xFFFF_FFFF]);
        assert_eq!(found, [[1.75 / 3.0, 1.0, 0.0], [0.0; 3], [0.0; 3], [1.0, 1.0, 0.0]]);
    }
}

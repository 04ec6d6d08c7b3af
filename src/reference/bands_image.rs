//! Twin of `bands_image.comp`: differences of an image from its photograph.

use super::FLOAT_MAX;

/// By pixel: differences of red and green, and 0; of the `second` pass that of blue, 1 and 0. All 0 if the pixel does not count
/// (alpha 0 of the packed target) or a difference is not finite. `image` is RGB and transmittance.
pub fn bands_image(image: &[[f64; 4]], targets: &[u32], second: bool) -> Vec<[f64; 3]> {
    let pixel = |(shown, &target): (&[f64; 4], &u32)| {
        let off: [f64; 3] = std::array::from_fn(|c| shown[c] - f64::from(target >> (8 * c) & 0xFF) / 255.0);
        let fine = target >> 24 != 0 && off.iter().map(|off| off.abs()).sum::<f64>() <= FLOAT_MAX;
        match (fine, second) {
            (false, _) => [0.0; 3],
            (true, false) => [off[0], off[1], 0.0],
            (true, true) => [off[2], 1.0, 0.0],
        }
    };
    image.iter().zip(targets).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_do_not_count_or_are_no_number_have_no_part() {
        let image = [[0.5, 0.25, 1.0, 0.0], [1.0; 4], [f64::NAN, 0.0, 0.0, 0.0], [0.0; 4]];
        let targets = [0xFF00_0000, 0x0000_0000, 0xFF00_0000, 0xFFFF_FFFF];
        assert_eq!(bands_image(&image, &targets, false), [[0.5, 0.25, 0.0], [0.0; 3], [0.0; 3], [-1.0, -1.0, 0.0]]);
        assert_eq!(bands_image(&image, &targets, true), [[1.0, 1.0, 0.0], [0.0; 3], [0.0; 3], [-1.0, 1.0, 0.0]]);
    }
}

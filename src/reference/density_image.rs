//! Twin of `density_image.comp`: per-pixel terms of the Gaussians' scores.

use super::FLOAT_MAX;
use crate::stages::constants::density::{BLUE, RED_GREEN};

/// Two numbers by `terms`, and 0. All 0 if the pixel does not count (alpha 0 of the packed target) or its mean
/// |difference| is not finite. `image` is RGB and transmittance.
pub fn density_image(image: &[[f64; 4]], targets: &[u32], terms: u32) -> Vec<[f64; 3]> {
    let pixel = |(shown, &target): (&[f64; 4], &u32)| {
        let channel = |c: usize| f64::from(target >> (8 * c) & 0xFF) / 255.0;
        let off: [f64; 3] = std::array::from_fn(|c| shown[c] - channel(c));
        let error = off.iter().map(|off| off.abs()).sum::<f64>() / 3.0;
        match terms {
            _ if target >> 24 == 0 || !(error <= FLOAT_MAX) => [0.0; 3],
            RED_GREEN => [off[0], off[1], 0.0],
            BLUE => [off[2], 1.0, 0.0],
            _ => [error, 1.0, 0.0],
        }
    };
    image.iter().zip(targets).map(pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::constants::density::ERRORS;

    #[test]
    fn pixels_that_do_not_count_or_are_no_number_have_no_part() {
        let image = [[0.5, 0.25, 1.0, 0.0], [1.0; 4], [f64::NAN, 0.0, 0.0, 0.0], [0.0; 4]];
        let found = |terms| density_image(&image, &[0xFF00_0000, 0x0000_0000, 0xFF00_0000, 0xFFFF_FFFF], terms);
        assert_eq!(found(ERRORS), [[1.75 / 3.0, 1.0, 0.0], [0.0; 3], [0.0; 3], [1.0, 1.0, 0.0]]);
        assert_eq!(found(RED_GREEN), [[0.5, 0.25, 0.0], [0.0; 3], [0.0; 3], [-1.0, -1.0, 0.0]]);
        assert_eq!(found(BLUE), [[1.0, 1.0, 0.0], [0.0; 3], [0.0; 3], [-1.0, 1.0, 0.0]]);
    }
}

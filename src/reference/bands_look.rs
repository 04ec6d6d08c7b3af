//! Twin of `bands_look.comp`: the color that a view's pixels ask of a Gaussian, and its weight.

use crate::stages::constants::bands::{LEAST_WEIGHT, MOST_COLOR};

/// `sums` of differences by blend weight, of a Gaussian that is shown in this `color`; 0 if the view gives it no weight.
pub fn bands_look(color: [f64; 3], sums: [f64; 3], weight: f64) -> [f64; 4] {
    let asked: [f64; 3] = std::array::from_fn(|c| color[c] - sums[c] / weight);
    let fine = weight >= LEAST_WEIGHT.into() && asked.iter().all(|asked| asked.abs() <= MOST_COLOR.into());
    if fine { [asked[0], asked[1], asked[2], weight] } else { [0.0; 4] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian that alone covers a pixel takes the photograph's color; half transparent it takes it too.
    #[test]
    fn the_color_is_the_photographs_where_one_gaussian_covers_the_pixels() {
        for alpha in [1.0, 0.5] {
            let (color, photo) = ([0.2, 0.5, 0.9], [0.6, 0.1, 0.9]);
            // Over a background of the photograph's color.
            let sums = std::array::from_fn(|c| alpha * (alpha * color[c] + (1.0 - alpha) * photo[c] - photo[c]));
            let found = bands_look(color, sums, alpha);
            let moved = |c: usize| color[c] + alpha * (photo[c] - color[c]);
            assert!((0..3).all(|c| (found[c] - moved(c)).abs() < 1e-15) && found[3] == alpha, "{found:?}");
        }
        assert_eq!(bands_look([0.5; 3], [1e-4; 3], 1e-4), [0.0; 4]);
        assert_eq!(bands_look([f64::NAN; 3], [0.0; 3], 1.0), [0.0; 4]);
        assert_eq!(bands_look([0.5; 3], [0.0; 3], f64::NAN), [0.0; 4]);
    }
}

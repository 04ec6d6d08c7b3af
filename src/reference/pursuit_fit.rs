//! Twin of `pursuit_fit.comp`: finds the size, lobe width, opacity and color of a candidate with the largest
//! gain over all views.

use glam::DVec3;

use super::{
    FLOAT_MAX,
    pursuit::{Candidate, Fit, lobe_width, sigma_of},
    pursuit_score::Sums,
};
use crate::stages::constants::pursuit::{SUMS, WIDTHS};

const OPACITY_FIRST: f64 = 0.6;
const OPACITY_MIN: f64 = 0.1;
const OPACITY_MAX: f64 = 0.95;
const ROUNDS: usize = 3;

/// The opacity and color with the largest gain for one size and width; `None` if no view is within the lobe.
pub fn best_of(x: &[f64; SUMS as usize]) -> Option<(f64, DVec3, f64)> {
    let (a, b) = (DVec3::new(x[0], x[1], x[2]), DVec3::new(x[3], x[4], x[5]));
    if !(x[6] > 0.0) {
        return None;
    }
    let bend = |color: DVec3| x[8] - 2.0 * color.dot(b) + color.length_squared() * x[6];
    let (mut opacity, mut color) = (OPACITY_FIRST, DVec3::ZERO);
    for _ in 0..ROUNDS {
        color = ((a / opacity + b) / x[6]).clamp(DVec3::ZERO, DVec3::ONE);
        if bend(color) > 0.0 {
            opacity = ((color.dot(a) - x[7]) / bend(color)).clamp(OPACITY_MIN, OPACITY_MAX);
        }
    }
    let gain = 2.0 * opacity * (color.dot(a) - x[7]) - opacity * opacity * bend(color);
    Some((opacity, color, gain))
}

/// Factor of a gain after subtracting `doubt` of its standard errors, if views gain in proportion to a l².
pub fn certain(x: &[f64; SUMS as usize], doubt: f64) -> f64 {
    1.0 - doubt * x[9].sqrt() / x[6]
}

/// Finds the best fit. `sums` are by size, sizes in pixels of the view that the candidate was drawn in.
/// `worth` is the factor of a gain with a lobe and without, `doubt` the number of standard errors subtracted
/// from it.
pub fn pursuit_fit(c: &Candidate, sums: &[Sums], sizes: &[f64], worth: [f64; 2], doubt: f64) -> Fit {
    let (mut best, mut most, mut plain) = (Fit::default(), 0.0, 0.0f64);
    for (sums, &size) in sums.iter().zip(sizes) {
        for (w, x) in sums.iter().enumerate() {
            let is_plain = w as u32 == WIDTHS - 1;
            let worth = worth[usize::from(is_plain)];
            let Some((opacity, color, gain)) = best_of(x).filter(|(_, _, gain)| *gain <= FLOAT_MAX) else { continue };
            if is_plain {
                plain = plain.max(gain);
            }
            let counts = gain * worth * certain(x, doubt);
            if counts > most {
                most = counts;
                let width = lobe_width(w as u32, c.theta_bar);
                best = Fit { sigma: sigma_of(size, c.px), opacity, width, color, gain, support: x[6], plain: 0.0 };
            }
        }
    }
    Fit { plain, ..best }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Views of residual r, render b, lobe factor l and area a, one after the other.
    const VIEWS: [([f64; 3], [f64; 3], f64, f64); 3] = [
        ([0.3, 0.1, 0.2], [0.2, 0.3, 0.1], 1.0, 6.0),
        ([0.25, 0.2, 0.1], [0.3, 0.3, 0.2], 0.7, 9.0),
        ([-0.05, 0.0, 0.02], [0.5, 0.4, 0.4], 0.2, 5.0),
    ];

    fn brute(opacity: f64, color: DVec3) -> f64 {
        let one = |&(r, b, l, a): &([f64; 3], [f64; 3], f64, f64)| {
            let (r, b) = (DVec3::from_array(r), DVec3::from_array(b));
            a * (r.length_squared() - (r - opacity * l * (color - b)).length_squared())
        };
        VIEWS.iter().map(one).sum()
    }

    fn sums() -> [f64; SUMS as usize] {
        let mut x = [0.0; SUMS as usize];
        for (r, b, l, a) in VIEWS {
            for k in 0..3 {
                x[k] += a * l * r[k];
                x[3 + k] += a * l * l * b[k];
                x[7] += a * l * r[k] * b[k];
                x[8] += a * l * l * b[k] * b[k];
            }
            x[6] += a * l * l;
            x[9] += (a * l * l).powi(2);
        }
        x
    }

    #[test]
    fn the_gain_is_the_fall_of_the_squared_error_and_nearly_the_best() {
        let (opacity, color, gain) = best_of(&sums()).unwrap();
        assert!((gain - brute(opacity, color)).abs() < 1e-12);
        let steps = |n: usize| (0..=n).map(move |i| i as f64 / n as f64);
        let grid = steps(17).flat_map(|o| {
            let o = OPACITY_MIN + o * (OPACITY_MAX - OPACITY_MIN);
            steps(20)
                .flat_map(move |r| steps(20).flat_map(move |g| steps(20).map(move |b| brute(o, DVec3::new(r, g, b)))))
        });
        let most = grid.fold(f64::MIN, f64::max);
        // Three rounds leave a little: the gain is flat along opacity times contrast.
        assert!(gain > 0.98 * most, "{gain} of {most}");
    }

    #[test]
    fn what_is_worth_nothing_is_not_taken() {
        let mean = DVec3::ZERO;
        let c = Candidate { mean, toward: DVec3::X, px: 0.01, theta_bar: 0.2, view: 0, pixel: 0 };
        let all = [[sums(); WIDTHS as usize]; 2];
        let [lobes, plain, none] =
            [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]].map(|worth| pursuit_fit(&c, &all, &[1.0, 2.0], worth, 0.0));
        assert!(lobes.width > 0.0 && plain.width == 0.0 && plain.gain == lobes.gain && none.gain == 0.0);
        // Reported for any choice.
        assert_eq!([lobes.plain, plain.plain, none.plain], [plain.gain; 3]);
        // The first of equal fits.
        assert_eq!(plain.sigma, sigma_of(1.0, 0.01));
    }

    /// With four views of equal weight the standard error is half the gain; with one it is all of it.
    #[test]
    fn what_few_views_gain_counts_less() {
        let of_views = |n: f64| std::array::from_fn(|q| if q == 6 { n * 5.0 } else { n * 25.0 });
        assert_eq!([1.0, 4.0, 100.0].map(|n| certain(&of_views(n), 1.0)), [0.0, 0.5, 0.9]);
        assert_eq!(certain(&of_views(1.0), 0.0), 1.0);
    }
}

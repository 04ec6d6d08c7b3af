//! Twin of `bands_fit.comp`: harmonics fitted to what views ask of a Gaussian's color, and what they gain in views that were not
//! fitted.

use glam::DVec3;

use super::harmonics::basis;
use crate::{
    scene::layout::coefficients,
    stages::constants::{
        bands::{MOST_LEVERAGE, RIDGE},
        constants::SH_C0,
    },
};

/// Gain and coefficients of a Gaussian at `mean`, seen from `eyes`. A look is a color and its weight; 0: not seen.
pub fn bands_fit(mean: DVec3, eyes: &[DVec3], looks: &[[f64; 4]], degree: u32) -> (f64, Vec<[f64; 3]>) {
    let n = coefficients(degree);
    let seen: Vec<_> = eyes.iter().zip(looks).filter(|(_, look)| look[3] > 0.0).collect();
    let all: f64 = seen.iter().map(|(_, look)| look[3]).sum();
    if seen.is_empty() {
        return (0.0, vec![[0.0; 3]; n]);
    }
    let middle: [f64; 3] = std::array::from_fn(|c| seen.iter().map(|(_, look)| look[3] * look[c]).sum::<f64>() / all);
    let rows: Vec<_> = seen.iter().map(|&(&eye, look)| (basis(degree, (mean - eye).normalize()), look)).collect();
    let mut matrix = vec![vec![0.0; n]; n];
    let mut fit = vec![[0.0; 3]; n];
    for (basis, look) in &rows {
        for k in 0..n {
            (0..3).for_each(|c| fit[k][c] += look[3] * basis[k] * (look[c] - middle[c]));
            (0..=k).for_each(|m| matrix[k][m] += look[3] * basis[k] * basis[m]);
        }
    }
    let mut sound = true;
    for k in 0..n {
        matrix[k][k] += if k > 0 { f64::from(RIDGE) * all } else { 0.0 };
        for m in 0..=k {
            let left = matrix[k][m] - (0..m).map(|j| matrix[k][j] * matrix[m][j]).sum::<f64>();
            sound &= m < k || left > 0.0;
            matrix[k][m] = if m < k { left / matrix[m][m] } else { left.max(1e-30).sqrt() };
        }
    }
    for k in 0..n {
        let known: [f64; 3] = std::array::from_fn(|c| (0..k).map(|m| matrix[k][m] * fit[m][c]).sum());
        (0..3).for_each(|c| fit[k][c] = (fit[k][c] - known[c]) / matrix[k][k]);
    }
    for k in (0..n).rev() {
        let known: [f64; 3] = std::array::from_fn(|c| (k + 1..n).map(|m| matrix[m][k] * fit[m][c]).sum());
        (0..3).for_each(|c| fit[k][c] = (fit[k][c] - known[c]) / matrix[k][k]);
    }
    let most = f64::from(MOST_LEVERAGE);
    let mut gain = 0.0;
    for (basis, look) in &rows {
        let mut solved = vec![0.0; n];
        for k in 0..n {
            solved[k] = (basis[k] - (0..k).map(|m| matrix[k][m] * solved[m]).sum::<f64>()) / matrix[k][k];
        }
        let leverage = look[3] * solved.iter().map(|s| s * s).sum::<f64>();
        if leverage >= most {
            continue;
        }
        for c in 0..3 {
            let alone = (look[c] - middle[c]) / (1.0 - look[3] / all);
            let left = look[c] - middle[c] - (0..n).map(|k| basis[k] * fit[k][c]).sum::<f64>();
            gain += look[3] * (alone * alone - (left / (1.0 - leverage)).powi(2));
        }
    }
    (0..3).for_each(|c| fit[0][c] += (middle[c] - 0.5) / f64::from(SH_C0));
    if sound { (gain, fit) } else { (0.0, vec![[0.0; 3]; n]) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::hash::pcg4d;

    /// Eyes on a half sphere around the origin.
    fn eyes(count: u32) -> Vec<DVec3> {
        let unit = |i: u32, j: usize| f64::from(pcg4d([i, 7, 1, 3])[j]) / f64::from(u32::MAX);
        let eye = |i| DVec3::new(unit(i, 0) - 0.5, unit(i, 1) - 0.5, 0.2 + unit(i, 2)).normalize() * 4.0;
        (0..count).map(eye).collect()
    }

    /// The gain is what it says: each view left out in turn, the others fitted, the error taken in the view.
    #[test]
    fn the_gain_is_that_of_views_left_out_one_by_one() {
        let (eyes, mean) = (eyes(40), DVec3::new(0.1, -0.2, 0.05));
        let look = |(i, eye): (usize, &DVec3)| {
            let noise = |c: u32| f64::from(pcg4d([i as u32, c, 5, 9])[0]) / f64::from(u32::MAX) - 0.5;
            let gloss = (mean - *eye).normalize().x;
            [0, 1, 2].map(|c| 0.4 + 0.3 * gloss + 0.1 * noise(c))
        };
        let looks: Vec<_> = eyes.iter().enumerate().map(look).map(|[r, g, b]| [r, g, b, 2.0 + 3.0 * r]).collect();
        for degree in [1, 2] {
            let all: f64 = looks.iter().map(|look| look[3]).sum();
            let mut gain = 0.0;
            for v in 0..eyes.len() {
                let mut others = looks.clone();
                others[v] = [0.0; 4];
                let left: f64 = all - looks[v][3];
                let middle = |c: usize| others.iter().map(|look| look[3] * look[c]).sum::<f64>() / left;
                // The ridge is relative to the weights of all views.
                let fit = fit_with_ridge(mean, &eyes, &others, degree, f64::from(RIDGE) * all / left, &looks);
                let basis = basis(degree, (mean - eyes[v]).normalize());
                for c in 0..3 {
                    let shown: f64 = 0.5 + (0..fit.len()).map(|k| basis[k] * fit[k][c]).sum::<f64>();
                    gain += looks[v][3] * ((looks[v][c] - middle(c)).powi(2) - (looks[v][c] - shown).powi(2));
                }
            }
            let (found, _) = bands_fit(mean, &eyes, &looks, degree);
            assert!((found / gain - 1.0).abs() < 1e-9 && found > 1.0, "{found} is {gain}");
        }
    }

    /// Least squares by elimination, about the mean color of all `looks`.
    fn fit_with_ridge(
        mean: DVec3,
        eyes: &[DVec3],
        looks: &[[f64; 4]],
        degree: u32,
        ridge: f64,
        about: &[[f64; 4]],
    ) -> Vec<[f64; 3]> {
        let n = coefficients(degree);
        let sum = |looks: &[[f64; 4]]| looks.iter().map(|look| look[3]).sum::<f64>();
        let middle: [f64; 3] =
            std::array::from_fn(|c| about.iter().map(|look| look[3] * look[c]).sum::<f64>() / sum(about));
        let mut rows = vec![vec![0.0; n + 3]; n];
        for (&eye, look) in eyes.iter().zip(looks) {
            let basis = basis(degree, (mean - eye).normalize());
            for k in 0..n {
                (0..n).for_each(|m| rows[k][m] += look[3] * basis[k] * basis[m]);
                (0..3).for_each(|c| rows[k][n + c] += look[3] * basis[k] * (look[c] - middle[c]));
            }
        }
        (1..n).for_each(|k| rows[k][k] += ridge * sum(looks));
        for k in 0..n {
            for other in (0..n).filter(|&other| other != k) {
                let share = rows[other][k] / rows[k][k];
                (0..n + 3).for_each(|m| rows[other][m] -= share * rows[k][m]);
            }
        }
        let mut fit: Vec<[f64; 3]> = (0..n).map(|k| std::array::from_fn(|c| rows[k][n + c] / rows[k][k])).collect();
        (0..3).for_each(|c| fit[0][c] += (middle[c] - 0.5) / f64::from(SH_C0));
        fit
    }

    /// Noise gains nothing, and neither does what few views see.
    #[test]
    fn chance_gains_nothing() {
        let eyes = eyes(60);
        let mut sums = [0.0; 4];
        for trial in 0..200 {
            let noise = |i: u32, c: u32| f64::from(pcg4d([trial, i, c, 2])[1]) / f64::from(u32::MAX);
            let looks: Vec<_> = (0..60).map(|i| [noise(i, 0), noise(i, 1), noise(i, 2), 1.0]).collect();
            (0..3).for_each(|d| sums[d] += bands_fit(DVec3::ZERO, &eyes, &looks, d as u32 + 1).0);
            let mut few = vec![[0.0; 4]; 60];
            few[..3].copy_from_slice(&looks[..3]);
            sums[3] += bands_fit(DVec3::ZERO, &eyes, &few, 3).0;
        }
        assert!(sums.iter().all(|&sum| sum < 0.0), "{sums:?}");
        assert_eq!(bands_fit(DVec3::ZERO, &eyes, &[[0.0; 4]; 60], 2), (0.0, vec![[0.0; 3]; 9]));
    }
}

//! Finds floaters: a few Gaussians far beyond all others, which would cost the other positions their
//! precision.

use crate::scene::Gaussians;

/// At most one Gaussian in this number is a floater: more than that are a background.
const NTH: usize = 100;
/// A floater's distance from the middle is at least this multiple of the distance of nine in ten Gaussians.
const FAR: f64 = 100.0;

/// The largest coordinate of a mean.
fn reach(mean: &[f32; 3]) -> f64 {
    mean.iter().fold(0.0, |most, &v| f64::from(v).abs().max(most))
}

/// The largest coordinate of all Gaussians, and of all except possible floaters.
pub(super) fn reaches(means: &[[f32; 3]]) -> [f64; 2] {
    let mut all: Vec<f64> = means.iter().map(reach).collect();
    all.sort_by(f64::total_cmp);
    let from_end = |n: usize| all.len().checked_sub(1 + n).map_or(0.0, |i| all[i]);
    [0, all.len() / NTH].map(from_end)
}

/// Moves Gaussians beyond `limit` to it, towards the coordinate origin, and shrinks them in proportion: from
/// there they look the same. Returns their number.
pub(super) fn move_in(gaussians: &mut Gaussians, limit: f64) -> usize {
    let mut moved = 0;
    for (mean, scales) in gaussians.means.iter_mut().zip(&mut gaussians.log_scales) {
        let share = limit / reach(mean);
        if share < 1.0 {
            *mean = mean.map(|v| (f64::from(v) * share) as f32);
            *scales = scales.map(|v| v + share.ln() as f32);
            moved += 1;
        }
    }
    moved
}

/// The middle of most Gaussians, and the distance from it beyond which a Gaussian is a floater; infinite if
/// there are none.
pub(super) fn core(means: &[[f32; 3]]) -> ([f64; 3], f64) {
    let at = |mut values: Vec<f64>, n: usize| *values.select_nth_unstable_by(n, f64::total_cmp).1;
    let Some(last) = means.len().checked_sub(1) else { return ([0.0; 3], f64::INFINITY) };
    let middle = [0, 1, 2].map(|axis| at(means.iter().map(|mean| f64::from(mean[axis])).collect(), last / 2));
    let distances: Vec<f64> = means.iter().map(|mean| distance(mean, middle)).collect();
    let limit = FAR * at(distances.clone(), last * 9 / 10);
    let beyond = distances.iter().filter(|&&d| d > limit).count();
    (middle, if limit > 0.0 && (1..=means.len() / NTH).contains(&beyond) { limit } else { f64::INFINITY })
}

/// Distance of a mean from a point.
pub(super) fn distance(mean: &[f32; 3], from: [f64; 3]) -> f64 {
    (0..3).map(|axis| (f64::from(mean[axis]) - from[axis]).powi(2)).sum::<f64>().sqrt()
}

/// Median size of a Gaussian along an axis, to judge the step of a grid; 0 without Gaussians.
pub(super) fn median_size(log_scales: &[[f32; 3]]) -> f64 {
    let mut all: Vec<f32> = log_scales.as_flattened().to_vec();
    let middle = all.len() / 2;
    if all.is_empty() { 0.0 } else { f64::from(*all.select_nth_unstable_by(middle, f32::total_cmp).1).exp() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floater_moves_in_along_its_ray_and_looks_as_large() {
        let means = [vec![[1.0f32, 2.0, 3.0]; 200], vec![[4e6, -2e6, 1e6]]].concat();
        let log_scales = vec![[0.0, 1.0, -2.0]; 201];
        let mut gaussians = Gaussians { means, log_scales, ..Default::default() };
        assert_eq!(reaches(&gaussians.means), [4e6, 3.0]);
        assert_eq!(core(&gaussians.means).0, [1.0, 2.0, 3.0]);
        assert_eq!(move_in(&mut gaussians, 2000.0), 1);
        assert_eq!(gaussians.means[200], [2000.0, -1000.0, 500.0]);
        let shrunk = [0.0f32, 1.0, -2.0].map(|v| v - 2000f32.ln());
        assert!((0..3).all(|axis| (gaussians.log_scales[200][axis] - shrunk[axis]).abs() < 1e-5));
        assert_eq!((gaussians.means[199], gaussians.log_scales[199]), ([1.0, 2.0, 3.0], [0.0, 1.0, -2.0]));
        // With fewer than a hundred, none is excluded.
        assert_eq!(reaches(&gaussians.means[150..]), [2000.0; 2]);
        assert_eq!((reaches(&[]), core(&[]).1), ([0.0; 2], f64::INFINITY));
    }

    #[test]
    fn what_lies_far_beyond_all_others_is_no_part_of_the_core() {
        let ball = |i: i32| [i % 5, i / 5 % 5, i / 25].map(|v| v as f32);
        let mut means: Vec<[f32; 3]> = (0..125).map(ball).collect();
        assert_eq!(core(&means).1, f64::INFINITY);
        means.push([9e4, 0.0, 0.0]);
        let (middle, limit) = core(&means);
        assert!(limit > 100.0 && limit < 1000.0 && means[..125].iter().all(|mean| distance(mean, middle) < limit));
    }
}

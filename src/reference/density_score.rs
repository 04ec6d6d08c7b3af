//! Twin of `density_score.comp`: one view's contribution to a Gaussian's scores.

use super::{FLOAT_MAX, Splat, blend_backward::Record, project_backward::centre_gradient};

/// Returns the addition to the scores, from the sum of a Gaussian's records: error and blend weight. With
/// `pulls` (half the image's sides): the length of the mean's gradient in halves of these, and 1 if it is
/// blended.
pub fn density_score(record: &Record, splat: &Splat, pulls: Option<[f64; 2]>) -> [f64; 2] {
    let add = match pulls {
        None => [record[6], record[7]],
        Some(half) => {
            let blended = record[..3].iter().any(|&part| part != 0.0);
            let [x, y] = centre_gradient(splat, record);
            if blended { [(x * half[0]).hypot(y * half[1]), 1.0] } else { [0.0; 2] }
        }
    };
    if add.iter().all(|&a| a <= FLOAT_MAX) { add } else { [0.0; 2] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_and_what_is_not_blended_add_nothing() {
        let splat = Splat { l11: 2.0, l12: 0.0, l22: 0.5, ..Splat::default() };
        let record = |first: [f64; 3], color: [f64; 3]| std::array::from_fn(|r| [first, [0.0; 3], color][r / 3][r % 3]);
        let some = record([1.5, 16.0, 0.1], [0.25, 3.0, 0.0]);
        assert_eq!(density_score(&some, &splat, None), [0.25, 3.0]);
        assert_eq!(density_score(&some, &splat, Some([1.0, 0.5])), [5.0, 1.0]);
        assert_eq!(density_score(&record([0.0; 3], [1.0; 3]), &splat, Some([1.0; 2])), [0.0; 2]);
        assert_eq!(density_score(&record([f64::NAN, 0.0, 0.0], [f64::NAN, 1.0, 0.0]), &splat, None), [0.0; 2]);
        assert_eq!(density_score(&record([f64::NAN, 0.0, 0.0], [0.0; 3]), &splat, Some([1.0; 2])), [0.0; 2]);
    }
}

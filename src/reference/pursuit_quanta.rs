//! Twin of `pursuit_quanta.comp`: each block's share of the squared error as an integer.

use super::FLOAT_MAX;

/// ⌊2³⁰ · sum / total⌋; all 0 if the total is 0, infinite or NaN.
pub fn pursuit_quanta(error_sums: &[f64]) -> Vec<u32> {
    let total: f64 = error_sums.iter().sum();
    let usable = total > 0.0 && total <= FLOAT_MAX;
    let share = |&sum: &f64| (f64::from((sum / total).clamp(0.0, 1.0) as f32) * 1_073_741_824.0) as u32;
    error_sums.iter().map(|sum| if usable { share(sum) } else { 0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_of_the_errors() {
        assert_eq!(pursuit_quanta(&[1.0, 0.0, 3.0]), [1 << 28, 0, 3 << 28]);
        assert_eq!(pursuit_quanta(&[5.0]), [1 << 30]);
        assert_eq!(pursuit_quanta(&[0.0, 0.0]), [0, 0]);
        assert_eq!(pursuit_quanta(&[f64::NAN, 1.0]), [0, 0]);
    }
}

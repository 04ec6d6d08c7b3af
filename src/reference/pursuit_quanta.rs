//! Twin of `pursuit_quanta.comp`: each block's share of the squared error as an integer.

use super::FLOAT_MAX;

/// ⌊2³⁰ · sum / total⌋; all 0 if the total is 0, infinite or NaN.
pub fn pursuit_quanta(error_sums: &[f64]) -> Vec<u32> {
    let total: f64 = error_sums.iter().sum();
    let usable = total > 0.0 && total <= FLOAT_MAX;
    let share = |&sum: &f64| (f64::from((sum / total).clamp(0.0, 1.0) as f32) * 1_073_741_824.0) as u32;
    error_sums.iter().map(|sum| if usable { share(sum) } else { 0 }).collect()
}

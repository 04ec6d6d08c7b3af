//! Twin of `fma_rate.comp`: recurrences x ← factor · x + term, several for each thread.

/// The sum of the `chains` recurrences of each thread after `rounds`.
pub fn fma_rate(count: u32, chains: u32, rounds: u32, factor: f64, term: f64) -> Vec<f64> {
    let chain = |start: f64| (0..rounds).fold(start, |x, _| factor * x + term);
    (0..count).map(|i| (0..chains).map(|k| chain(f64::from(i % 1024) + f64::from(k))).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x_n − L = factorⁿ (x_0 − L) with L = term / (1 − factor).
    #[test]
    fn the_recurrence_has_its_closed_form() {
        let sums = fma_rate(3, 8, 20, 0.9, 0.25);
        for (i, sum) in sums.iter().enumerate() {
            let expected: f64 = (0..8).map(|k| 2.5 + 0.9f64.powi(20) * ((i + k) as f64 - 2.5)).sum();
            assert!((sum - expected).abs() < 1e-12);
        }
    }
}

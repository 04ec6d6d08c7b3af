//! Twin of `fma_rate.comp`: recurrences x ← factor · x + term, several for each thread.

/// The sum of the `chains` recurrences of each thread after `rounds`.
pub fn fma_rate(count: u32, chains: u32, rounds: u32, factor: f64, term: f64) -> Vec<f64> {
    let chain = |start: f64| (0..rounds).fold(start, |x, _| factor * x + term);
    (0..count).map(|i| (0..chains).map(|k| chain(f64::from(i % 1024) + f64::from(k))).sum()).collect()
}

//! Codebooks: 256 values that approximate many numbers.

/// Rounds of Lloyd's algorithm; on real scenes it converges long before.
const ROUNDS: usize = 64;
/// Number of entries, one per byte value.
pub(super) const ENTRIES: usize = 256;

/// Values in ascending order that minimise the mean square distance of each number to the nearest value.
pub(super) struct Codebook(pub(super) Vec<f32>);

impl Codebook {
    /// Lloyd's algorithm ("Least squares quantization in PCM", 1982) on sorted values, so that a cluster is a
    /// range.
    pub(super) fn of(values: impl IntoIterator<Item = f32>) -> Codebook {
        let mut sorted: Vec<f32> = values.into_iter().collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let mut unique = sorted.clone();
        unique.dedup();
        if unique.len() <= ENTRIES {
            // Readers expect 256 entries.
            let last = unique.last().copied().unwrap_or(0.0);
            unique.resize(ENTRIES, last);
            return Codebook(unique);
        }
        // Prefix sums, so that a range's mean takes two look-ups.
        let mut sum = 0.0;
        let sums: Vec<f64> = std::iter::once(0.0).chain(sorted.iter().map(|&v| (sum += f64::from(v), sum).1)).collect();
        let (low, high) = (f64::from(sorted[0]), f64::from(sorted[sorted.len() - 1]));
        // Initial centres alternate between even steps, for the tails, and even counts, for the bulk, however
        // long the tails are.
        let mut centres: Vec<f64> = (0..ENTRIES)
            .map(|i| {
                let share = (i as f64 + 0.5) / ENTRIES as f64;
                let quantile = f64::from(sorted[(share * sorted.len() as f64) as usize]);
                if i % 2 == 0 { low + (high - low) * share } else { quantile }
            })
            .collect();
        centres.sort_unstable_by(f64::total_cmp);
        for _ in 0..ROUNDS {
            let mut begin = 0;
            for i in 0..ENTRIES {
                let end = match centres.get(i + 1) {
                    Some(next) => {
                        let border = 0.5 * (centres[i] + next);
                        begin + sorted[begin..].partition_point(|&v| f64::from(v) <= border)
                    }
                    None => sorted.len(),
                };
                if end > begin {
                    centres[i] = (sums[end] - sums[begin]) / (end - begin) as f64;
                }
                begin = end;
            }
        }
        centres.sort_unstable_by(f64::total_cmp);
        Codebook(centres.into_iter().map(|v| v as f32).collect())
    }

    /// Index of the nearest entry.
    pub(super) fn index(&self, value: f32) -> u8 {
        let after = self.0.partition_point(|&entry| entry < value);
        let nearer = |i: &usize| (self.0[*i] - value).abs();
        let candidates = [after.saturating_sub(1), after.min(ENTRIES - 1)];
        candidates.into_iter().min_by(|a, b| nearer(a).total_cmp(&nearer(b))).unwrap_or(0) as u8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_are_kept_as_they_are() {
        let book = Codebook::of([3.0, -1.0, 3.0, 0.5]);
        assert_eq!((book.0.len(), &book.0[..3]), (256, &[-1.0, 0.5, 3.0][..]));
        for value in [3.0, -1.0, 0.5] {
            assert_eq!(book.0[usize::from(book.index(value))], value);
        }
        assert_eq!(Codebook::of([]).0, [0.0; 256]);
    }

    #[test]
    fn many_values_are_near_their_entries_and_even_ones_as_near_as_can_be() {
        let even: Vec<f32> = (0..100_000).map(|i| i as f32 / 1e5).collect();
        let error = |book: &Codebook| {
            let off = |v: &f32| f64::from(book.0[usize::from(book.index(*v))] - v).powi(2);
            even.iter().map(off).sum::<f64>() / even.len() as f64
        };
        let book = Codebook::of(even.iter().copied());
        // A step of 1/256 has the variance step²/12.
        assert!(book.0.is_sorted() && (error(&book) * 12.0 * 65536.0 - 1.0).abs() < 0.01, "{}", error(&book));
        // An infinitely thin Gaussian uses at most half of the entries.
        let book = Codebook::of(even.iter().copied().chain([-87.0]));
        assert!(error(&book) * 12.0 * 65536.0 < 4.2 && book.0[0] == -87.0, "{}", error(&book));
    }
}

//! Making pictures smaller.

/// Takes the rows of a picture from the top and makes a smaller one of them: the mean over the area of each pixel, as a sensor
/// with fewer, larger cells would see it. Holds the smaller picture and a row. Not for enlarging.
pub(super) struct Reducer {
    columns: Vec<(usize, Vec<f32>)>,
    rows: Vec<(usize, Vec<f32>)>,
    /// Rows that have come.
    fed: usize,
    /// The first row of the result that is not finished.
    open: usize,
    narrow: Vec<[f32; 4]>,
    out: Vec<[f32; 4]>,
}

impl Reducer {
    pub(super) fn new(from: [u32; 2], to: [u32; 2]) -> Reducer {
        Reducer {
            columns: coverage(from[0], to[0]),
            rows: coverage(from[1], to[1]),
            fed: 0,
            open: 0,
            narrow: vec![[0.0; 4]; to[0] as usize],
            out: vec![[0.0; 4]; to[0] as usize * to[1] as usize],
        }
    }

    pub(super) fn feed(&mut self, row: &[[f32; 4]]) {
        for (pixel, (first, weights)) in self.narrow.iter_mut().zip(&self.columns) {
            *pixel = [0.0; 4];
            weights.iter().zip(&row[*first..]).for_each(|(&weight, &value)| add(pixel, weight, value));
        }
        let width = self.narrow.len();
        for (y, (first, weights)) in self.rows.iter().enumerate().skip(self.open) {
            let Some(at) = self.fed.checked_sub(*first) else { break };
            match weights.get(at) {
                Some(&weight) => {
                    let out = &mut self.out[y * width..(y + 1) * width];
                    out.iter_mut().zip(&self.narrow).for_each(|(pixel, &value)| add(pixel, weight, value));
                }
                None => self.open = y + 1,
            }
        }
        self.fed += 1;
    }

    /// Once all rows have come.
    pub(super) fn finish(self) -> Vec<[f32; 4]> {
        self.out
    }
}

fn add(sum: &mut [f32; 4], weight: f32, value: [f32; 4]) {
    sum.iter_mut().zip(value).for_each(|(sum, value)| *sum += weight * value);
}

/// For each of `to` cells laid over `from` pixels: the first pixel it touches and the shares, summing to 1, of each.
fn coverage(from: u32, to: u32) -> Vec<(usize, Vec<f32>)> {
    let cell = from as f64 / to as f64;
    let span = |i: u32| {
        let (begin, end) = (i as f64 * cell, ((i + 1) as f64 * cell).min(from as f64));
        let first = begin as usize;
        // A sliver that is only rounding error gets a weight of its size.
        let pixels = first..(end.ceil() as usize).clamp(first + 1, from as usize);
        let share = |p: usize| (end.min((p + 1) as f64) - begin.max(p as f64)).max(0.0) / (end - begin);
        (first, pixels.map(|p| share(p) as f32).collect())
    };
    (0..to).map(span).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reduce(pixels: &[[f32; 4]], from: [u32; 2], to: [u32; 2]) -> Vec<[f32; 4]> {
        let mut reducer = Reducer::new(from, to);
        pixels.chunks_exact(from[0] as usize).for_each(|row| reducer.feed(row));
        reducer.finish()
    }

    #[test]
    fn shrinking_keeps_the_mean_whatever_the_sizes() {
        let (width, height) = (37, 23);
        let pixels: Vec<[f32; 4]> =
            (0..width * height).map(|i| [(i % 7) as f32 / 7.0, (i % 5) as f32 / 5.0, 0.25, 1.0]).collect();
        let mean = |p: &[[f32; 4]], c: usize| p.iter().map(|v| v[c] as f64).sum::<f64>() / p.len() as f64;
        for [w, h] in [[36, 22], [18, 11], [10, 7], [1, 1], [37, 3]] {
            let small = reduce(&pixels, [width, height], [w, h]);
            assert_eq!(small.len(), (w * h) as usize);
            for c in 0..4 {
                // Float32 weights: 1e-7 each.
                assert!((mean(&small, c) - mean(&pixels, c)).abs() < 1e-6, "{w} × {h}");
            }
        }
    }

    #[test]
    fn halving_is_the_mean_of_four_and_the_same_size_changes_no_bit() {
        let pixels: Vec<[f32; 4]> = (0..16).map(|i| [i as f32, 0.1 * i as f32, 1.0, 0.0]).collect();
        let small = reduce(&pixels, [4, 4], [2, 2]);
        assert_eq!(small.iter().map(|p| p[0]).collect::<Vec<_>>(), [2.5, 4.5, 10.5, 12.5]);
        assert_eq!(reduce(&pixels, [4, 4], [4, 4]), pixels);
    }

    #[test]
    fn coverage_touches_every_pixel_once() {
        for (from, to) in [(5, 3), (100, 99), (3, 1), (4946, 1237), (7, 7), (32768, 32767)] {
            let mut total = vec![0.0f64; from as usize];
            for (first, weights) in coverage(from, to) {
                assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                weights.iter().enumerate().for_each(|(i, &w)| total[first + i] += w as f64 * from as f64 / to as f64);
            }
            assert!(total.iter().all(|t| (t - 1.0).abs() < 1e-4), "{from} to {to}");
        }
    }
}

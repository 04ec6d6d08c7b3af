//! Downscales pictures.

/// Method of downscaling.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Reduce {
    /// Mean over each pixel's area, like a sensor with fewer, larger cells
    #[default]
    Area,
    /// Bicubic filter as in the code of 3DGS, for comparison with published figures
    // Keys' cubic with a = −1/2, stretched by the scale factor: Pillow's `BICUBIC`, except for its rounding
    // to bytes between the two directions.
    Bicubic,
}

/// Source pixels of a result pixel: the first, and for each its weight and its coverage for masks. Both sum
/// to 1; a weight may be negative, a coverage may not.
type Parts = (usize, Vec<[f32; 2]>);

/// Downscales a picture row by row from the top: three colors, and a mask, which is always an average. Holds
/// the smaller picture and one row. Cannot enlarge.
pub(super) struct Reducer {
    columns: Vec<Parts>,
    rows: Vec<Parts>,
    /// Rows received.
    fed: usize,
    /// The first unfinished row of the result.
    open: usize,
    narrow: Vec<[f32; 4]>,
    out: Vec<[f32; 4]>,
}

impl Reducer {
    pub(super) fn new(from: [u32; 2], to: [u32; 2], reduce: Reduce) -> Reducer {
        let parts = |side: usize| match reduce {
            Reduce::Area => coverage(from[side], to[side]),
            Reduce::Bicubic => bicubic(from[side], to[side]),
        };
        Reducer {
            columns: parts(0),
            rows: parts(1),
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

    /// Call after all rows.
    pub(super) fn finish(self) -> Vec<[f32; 4]> {
        self.out
    }
}

fn add(sum: &mut [f32; 4], [weight, share]: [f32; 2], value: [f32; 4]) {
    sum.iter_mut().zip(value).zip([weight, weight, weight, share]).for_each(|((sum, value), w)| *sum += w * value);
}

/// For each of `to` cells over `from` pixels: the pixels that it touches, weighted by their overlap.
fn coverage(from: u32, to: u32) -> Vec<Parts> {
    let cell = from as f64 / to as f64;
    let span = |i: u32| {
        let (begin, end) = (i as f64 * cell, ((i + 1) as f64 * cell).min(from as f64));
        let first = begin as usize;
        // A sliver from rounding gets a negligible weight.
        let pixels = first..(end.ceil() as usize).clamp(first + 1, from as usize);
        let share = |p: usize| (end.min((p + 1) as f64) - begin.max(p as f64)).max(0.0) / (end - begin);
        (first, pixels.map(|p| [share(p) as f32; 2]).collect())
    };
    (0..to).map(span).collect()
}

/// Keys' cubic with a = −1/2.
fn cubic(x: f64) -> f64 {
    match x.abs() {
        x if x < 1.0 => (1.5 * x - 2.5) * x * x + 1.0,
        x if x < 2.0 => ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0,
        _ => 0.0,
    }
}

/// For each of `to` cells over `from` pixels: the pixels within two cells of its middle. Pixels beyond the
/// edge are left out, and their weight goes to the others.
fn bicubic(from: u32, to: u32) -> Vec<Parts> {
    let cell = from as f64 / to as f64;
    let parts = |i: u32| {
        let middle = (i as f64 + 0.5) * cell;
        let first = (middle - 2.0 * cell).max(0.0) as usize;
        let pixels = first..((middle + 2.0 * cell).ceil() as usize).min(from as usize);
        let weights: Vec<f64> = pixels.map(|p| cubic((p as f64 + 0.5 - middle) / cell)).collect();
        let (sum, magnitudes) = weights.iter().fold((0.0, 0.0), |(sum, all), w| (sum + w, all + w.abs()));
        (first, weights.iter().map(|w| [(w / sum) as f32, (w.abs() / magnitudes) as f32]).collect())
    };
    (0..to).map(parts).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reduce_by(reduce: Reduce, pixels: &[[f32; 4]], from: [u32; 2], to: [u32; 2]) -> Vec<[f32; 4]> {
        let mut reducer = Reducer::new(from, to, reduce);
        pixels.chunks_exact(from[0] as usize).for_each(|row| reducer.feed(row));
        reducer.finish()
    }

    #[test]
    fn halving_is_the_mean_of_four_and_the_same_size_changes_no_bit() {
        let pixels: Vec<[f32; 4]> = (0..16).map(|i| [i as f32, 0.1 * i as f32, 1.0, 0.0]).collect();
        let reduce = |to| reduce_by(Reduce::Area, &pixels, [4, 4], to);
        assert_eq!(reduce([2, 2]).iter().map(|p| p[0]).collect::<Vec<_>>(), [2.5, 4.5, 10.5, 12.5]);
        assert_eq!(reduce([4, 4]), pixels);
    }

    #[test]
    fn coverage_touches_every_pixel_once() {
        for (from, to) in [(5, 3), (100, 99), (3, 1), (4946, 1237), (7, 7), (32768, 32767)] {
            let mut total = vec![0.0f64; from as usize];
            for (first, weights) in coverage(from, to) {
                assert!((weights.iter().map(|[w, _]| w).sum::<f32>() - 1.0).abs() < 1e-5);
                weights
                    .iter()
                    .enumerate()
                    .for_each(|(i, &[w, _])| total[first + i] += w as f64 * from as f64 / to as f64);
            }
            assert!(total.iter().all(|t| (t - 1.0).abs() < 1e-4), "{from} to {to}");
        }
    }

    /// The filter's definition in float64, with neither separate directions nor a window.
    fn definition(pixels: &[[f32; 4]], from: [u32; 2], to: [u32; 2], at: [u32; 2]) -> [f64; 3] {
        let (mut sum, mut all) = ([0.0; 3], 0.0);
        for (p, pixel) in pixels.iter().enumerate() {
            let [x, y] = [p as u32 % from[0], p as u32 / from[0]];
            let along = |side: usize, p: u32| {
                let cell = f64::from(from[side]) / f64::from(to[side]);
                let d = ((f64::from(p) + 0.5) / cell - (f64::from(at[side]) + 0.5)).abs();
                match d {
                    _ if d < 1.0 => 1.5 * d.powi(3) - 2.5 * d.powi(2) + 1.0,
                    _ if d < 2.0 => -0.5 * d.powi(3) + 2.5 * d.powi(2) - 4.0 * d + 2.0,
                    _ => 0.0,
                }
            };
            let weight = along(0, x) * along(1, y);
            all += weight;
            (0..3).for_each(|c| sum[c] += weight * f64::from(pixel[c]));
        }
        sum.map(|sum| sum / all)
    }

    #[test]
    fn bicubic_is_its_definition_whatever_the_sizes() {
        let from = [37, 23];
        let pixels: Vec<[f32; 4]> =
            (0..37 * 23).map(|i| [(i * 31 % 97) as f32 / 97.0, (i % 5) as f32, 0.25, 1.0]).collect();
        for to in [[36, 22], [18, 11], [10, 7], [1, 1], [37, 3], [37, 23]] {
            let small = reduce_by(Reduce::Bicubic, &pixels, from, to);
            for (i, got) in small.iter().enumerate() {
                let want = definition(&pixels, from, to, [i as u32 % to[0], i as u32 / to[0]]);
                // Up to 60 roundings of 6e-8 each, with magnitudes that sum to 4 · 1.19².
                (0..3)
                    .for_each(|c| assert!((f64::from(got[c]) - want[c]).abs() < 2e-5, "{to:?}, {i}: {got:?} {want:?}"));
                assert!((got[3] - 1.0).abs() < 4e-6);
            }
        }
    }

    /// A negative weight must not make up for a masked pixel.
    #[test]
    fn a_pixel_that_does_not_count_is_missed_under_negative_weights_too() {
        for out in 3..=10 {
            let pixels: Vec<[f32; 4]> = (0..16).map(|i| [0.5, 0.5, 0.5, f32::from(u8::from(i != out))]).collect();
            // The smallest coverage of a tap is 0.0117 / 1.19.
            assert!(reduce_by(Reduce::Bicubic, &pixels, [16, 1], [8, 1])[3][3] < 0.9902, "{out}");
        }
    }
}

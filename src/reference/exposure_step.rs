//! Twin of `exposure_step.comp`: the Adam step of one photograph's map of colors.

use super::{
    adam::{BETA1, BETA2, PlaneRate, adam_one},
    exposure_apply::{IDENTITY, Map},
};

/// Adam's moments of a map: the first ones of its entries, the second ones, and both moments of a gradient
/// that is always 1: 1 − β₁ᵗ and 1 − β₂ᵗ after t steps.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Moments {
    /// By entry.
    pub first: Map,
    /// By entry.
    pub second: Map,
    /// Divisors of the first and the second moment in the bias correction.
    pub corrections: [f64; 2],
}

/// Steps the map of `photo`, whose gradient is the sum of `sums`, with the rate `rate`. Then subtracts the
/// mean over all maps of (M − I | b) from each. `maps` and `moments` are by photograph. Nothing changes if a
/// gradient is not finite.
pub fn exposure_step(maps: &mut [Map], moments: &mut [Moments], photo: usize, sums: &[Map], rate: f64) {
    let gradient: Map = std::array::from_fn(|e| sums.iter().map(|sum| sum[e]).sum());
    if !gradient.iter().all(|g| g.is_finite()) {
        return;
    }
    let Moments { first, second, corrections } = &mut moments[photo];
    for (correction, beta) in corrections.iter_mut().zip([BETA1, BETA2]) {
        *correction = beta * *correction + (1.0 - beta);
    }
    for e in 0..12 {
        let moments = [&mut first[e], &mut second[e]];
        adam_one(&mut maps[photo][e], gradient[e], moments, &PlaneRate::free(rate), *corrections);
    }
    let count = maps.len() as f64;
    let mean: Map = std::array::from_fn(|e| maps.iter().map(|map| map[e] - IDENTITY[e]).sum::<f64>() / count);
    for map in maps {
        map.iter_mut().zip(mean).for_each(|(entry, mean)| *entry -= mean);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_as_long_as_the_rate_and_the_mean_stays_the_identity() {
        let (mut maps, mut moments) = ([IDENTITY; 4], [Moments::default(); 4]);
        let sums = [[0.25; 12], [0.75; 12]];
        exposure_step(&mut maps, &mut moments, 2, &sums, 0.01);
        // The photograph's own step less the mean, a quarter of that step.
        for (photo, off) in [(0, 0.0025), (1, 0.0025), (2, -0.0075), (3, 0.0025)] {
            for e in 0..12 {
                assert!((maps[photo][e] - IDENTITY[e] - off).abs() < 1e-12, "{photo}, {e}: {}", maps[photo][e]);
            }
        }
        assert_eq!((moments[0], moments[2].first[3]), (Moments::default(), 0.09999999999999998));
        for k in 0..40 {
            exposure_step(&mut maps, &mut moments, k % 3, &[[(k as f64).sin(); 12]], 0.01);
        }
        // 13 steps of its own and the one above.
        assert!((moments[2].corrections[0] - (1.0 - 0.9f64.powi(14))).abs() < 1e-12);
    }
}

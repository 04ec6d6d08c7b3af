//! Twin of `pursuit_blur.comp`: computes a level of a view's pyramid.

use glam::DVec2;

use super::pursuit::{FIRST_BLUR, NEXT_BLUR, Texel};

/// Computes `width` × `height` texels from the `from_size` ones of the level below, with `halve`, or of the
/// view itself.
pub fn pursuit_blur(from: &[Texel], from_size: [u32; 2], [width, height]: [u32; 2], halve: bool) -> Vec<Texel> {
    let (across, deviation) = if halve { (8, NEXT_BLUR) } else { (5, FIRST_BLUR) };
    let [from_width, from_height] = from_size.map(i64::from);
    let one = |i: u32| {
        let (x, y) = (i64::from(i % width), i64::from(i / width));
        let middle = |at: i64| if halve { (2 * at + 1) as f64 } else { at as f64 + 0.5 };
        let begin = |at: i64| if halve { 2 * at - 3 } else { at - 2 };
        let range = |at: i64, size: i64| begin(at).max(0)..(begin(at) + across).min(size);
        let (mut sum, mut total) = (Texel::default(), 0.0);
        for v in range(y, from_height) {
            for u in range(x, from_width) {
                let d = DVec2::new(u as f64 + 0.5 - middle(x), v as f64 + 0.5 - middle(y)) / deviation;
                let weight = (-0.5 * d.length_squared()).exp();
                let t = &from[(v * from_width + u) as usize];
                // Raw second moments, until the means are known.
                let covariance = t.covariance + t.difference.dot(t.render);
                sum.add(weight, &Texel { covariance, variance: t.variance + t.render.length_squared(), ..*t });
                total += weight;
            }
        }
        let (difference, render) = (sum.difference / total, sum.render / total);
        let covariance = sum.covariance / total - difference.dot(render);
        Texel { difference, render, covariance, variance: (sum.variance / total - render.length_squared()).max(0.0) }
    };
    (0..width * height).map(one).collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// For one bright texel far from the border the levels have the variances that the method names.
    #[test]
    fn levels_have_their_deviations() {
        let size = 64u32;
        let mut texels = vec![Texel::default(); (size * size) as usize];
        texels[(32 * size + 32) as usize].render = DVec3::ONE;
        let mut from = pursuit_blur(&texels, [size; 2], [size; 2], false);
        let mut sizes = size;
        for (k, wanted) in [0.7, 1.4, 2.8].into_iter().enumerate() {
            if k > 0 {
                from = pursuit_blur(&from, [sizes; 2], [sizes / 2; 2], true);
                sizes /= 2;
            }
            let px = f64::from(size / sizes);
            let (mut sum, mut second) = (0.0, 0.0);
            for (i, t) in from.iter().enumerate() {
                let x = (f64::from(i as u32 % sizes) + 0.5) * px - 32.5;
                sum += t.render.x;
                second += t.render.x * x * x;
            }
            // Taps end at 2.9 deviations, which takes 3 % of the variance.
            let deviation = (second / sum).sqrt();
            assert!((deviation / wanted - 1.0).abs() < 0.03, "level {k}: {deviation}");
        }
    }

    /// The variance within a texel of any level is the image's variance under the level's whole weight.
    #[test]
    fn variances_of_levels_are_those_of_the_image() {
        let size = 64u32;
        let wave = |i: u32, k: u32| ((i * k % 97) as f64 * 0.9).sin();
        let one = |i: u32| Texel {
            difference: 0.2 * DVec3::new(wave(i, 3), wave(i, 5), wave(i, 7) + wave(i, 5)),
            render: DVec3::splat(0.5) + 0.3 * DVec3::new(wave(i, 5), wave(i, 11), wave(i, 13)),
            ..Default::default()
        };
        let image: Vec<Texel> = (0..size * size).map(one).collect();
        let first = pursuit_blur(&image, [size; 2], [size; 2], false);
        let second = pursuit_blur(&first, [size; 2], [size / 2; 2], true);
        // Texel (16, 16) of the second level is the pixels' corner (33, 33); its taps end 3 + 4 px from there.
        let (mut total, mut weights) = (Texel::default(), 0.0);
        let tap = |d: f64, deviation: f64| (-0.5 * (d / deviation).powi(2)).exp();
        let across = |p: u32| -> f64 {
            // Weight of a pixel: over the texels of the first level from which the second is computed, each
            // with weights that sum to 1.
            let norm = |deviation: f64, reach: f64, offset: f64| {
                let mut sum = 0.0;
                let mut d = offset - reach;
                while d <= offset + reach {
                    sum += tap(d, deviation);
                    d += 1.0;
                }
                sum
            };
            let mut weight = 0.0;
            for u in 29..37u32 {
                let near = f64::from(p) - f64::from(u);
                if near.abs() <= 2.0 {
                    weight +=
                        tap(f64::from(u) + 0.5 - 33.0, NEXT_BLUR) * tap(near, FIRST_BLUR) / norm(FIRST_BLUR, 2.0, 0.0);
                }
            }
            weight
        };
        for y in 26..40u32 {
            for x in 26..40u32 {
                let (weight, t) = (across(x) * across(y), &image[(y * size + x) as usize]);
                let (covariance, variance) = (t.difference.dot(t.render), t.render.length_squared());
                total.add(weight, &Texel { covariance, variance, ..*t });
                weights += weight;
            }
        }
        let (difference, render) = (total.difference / weights, total.render / weights);
        let found = &second[(16 * size / 2 + 16) as usize];
        assert!((found.difference - difference).length() < 1e-12 && (found.render - render).length() < 1e-12);
        let covariance = total.covariance / weights - difference.dot(render);
        let variance = total.variance / weights - render.length_squared();
        assert!((found.covariance - covariance).abs() < 1e-12 && (found.variance - variance).abs() < 1e-12);
        assert!(variance > 0.01 && covariance.abs() > 1e-3, "{variance} {covariance}");
    }

    #[test]
    fn what_is_even_stays_even_up_to_the_border() {
        let even = Texel { difference: DVec3::splat(-0.2), render: DVec3::splat(0.6), ..Default::default() };
        for (size, halve) in [([5, 3], false), ([3, 2], true), ([1, 1], false)] {
            for t in pursuit_blur(&[even; 15], [5, 3], size, halve) {
                assert!((t.difference - even.difference).length() < 1e-15 && (t.render - even.render).length() < 1e-15);
                assert!(t.covariance.abs() < 1e-15 && t.variance < 1e-15);
            }
        }
    }
}

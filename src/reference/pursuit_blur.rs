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

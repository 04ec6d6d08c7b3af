//! Twin of `pursuit_gain.comp`: a candidate's remaining gain, given the part of the residual that earlier
//! choices explain.

use std::f64::consts::PI;

use glam::DVec3;

use super::pursuit::{Candidate, Fit, Ground, WHOLE};

/// The gain over the views of a page, and the sum of squares; `explained` by pixel of the page.
pub fn pursuit_gain(ground: &Ground<'_>, explained: &[u32], c: &Candidate, fit: &Fit, caution: f64) -> [f64; 2] {
    let one = |(v, s)| {
        let (alpha, t, deviation) = ground.meets(v, &s, fit)?;
        let pixel = (ground.plots[v as usize].pixel_first + s.pixel) as usize;
        let left = 1.0 - f64::from(explained[pixel]) / WHOLE;
        let before = 2.0 * left * t.difference;
        let after = before - alpha * (fit.color - t.render);
        let (area, l) = (PI * deviation * deviation, alpha / fit.opacity);
        let others = 1.0 - caution * area * l * l / fit.support;
        let [before, after] = [before, after].map(DVec3::length_squared);
        let hidden = alpha * (4.0 * left * t.covariance + alpha * t.variance);
        let alone = (before - after - hidden).min(0.0);
        Some(area * if others > 0.01 { before - after / (others * others) - hidden } else { alone })
    };
    ground.sights(c).filter_map(one).fold([0.0; 2], |[sum, squares], gain| [sum + gain, squares + gain * gain])
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::{
        reference::{
            DILATION, View,
            pursuit::{Texel, lobe_width, sigma_of},
            pursuit_attenuate::pursuit_attenuate,
            pursuit_blur::pursuit_blur,
            pursuit_score::pursuit_score,
        },
        scene::Camera,
        stages::{constants::pursuit::WIDTHS, types::Plot},
    };

    const SIZE: u32 = 16;
    /// Texels of the three levels.
    const TEXELS: u32 = 16 * 16 + 8 * 8 + 4 * 4;

    /// Three cameras in a row before a surface at depth 2, and a candidate on it.
    fn scene() -> (Vec<View>, Vec<Plot>, Candidate) {
        let view = |v: u32| {
            let translation = DVec3::new(-0.1 * f64::from(v), 0.0, 0.0);
            View::from_camera(&Camera { translation, ..Camera::new(SIZE, SIZE, 20.0) })
        };
        let plot = |v| Plot { texel_first: v * TEXELS, pixel_first: v * SIZE * SIZE, cell_first: 0, block_first: 0 };
        let mean = DVec3::new(0.05, 0.05, 2.0);
        let views: Vec<View> = (0..3).map(view).collect();
        let toward = (views[0].eye - mean).normalize();
        let pixel = 8 * SIZE + 8;
        (views, (0..3).map(plot).collect(), Candidate { mean, toward, px: 0.1, theta_bar: 0.05, view: 0, pixel })
    }

    fn texels() -> Vec<Texel> {
        let wave = |i: u32, k: f64| (f64::from(i) * k).sin();
        let one = |i| Texel {
            difference: 0.3 * DVec3::new(wave(i, 0.1), wave(i, 0.2), 0.5 + 0.5 * wave(i, 0.05)),
            render: DVec3::splat(0.4) + 0.3 * DVec3::new(wave(i, 0.3), wave(i, 0.07), wave(i, 0.11)),
            covariance: 0.02 * wave(i, 0.17),
            variance: 0.05 + 0.05 * wave(i, 0.13),
        };
        (0..3 * TEXELS).map(one).collect()
    }

    /// The sums give the decrease of the squared error, view by view, for any opacity, color, size and
    /// width.
    #[test]
    fn the_sums_say_what_each_view_gains() {
        let (views, plots, c) = scene();
        let texels = texels();
        let depths = vec![2.0; 3 * 256];
        let ground = Ground { views: &views, plots: &plots, surface_depths: &depths, texels: &texels, range: (0, 3) };
        assert_eq!(ground.sights(&c).count(), 3);
        let mut lobes = 0;
        for size in [0.6, 1.1, 2.4, 5.0] {
            let sigma = sigma_of(size, c.px);
            let sums = pursuit_score(&ground, &c, sigma);
            for (w, x) in sums.iter().enumerate() {
                let width = lobe_width(w as u32, c.theta_bar);
                for (opacity, color) in [(0.3, DVec3::new(0.9, 0.1, 0.4)), (0.95, DVec3::ZERO), (0.6, DVec3::ONE)] {
                    let fit = Fit { sigma, opacity, width, color, gain: 1.0, support: 1.0, plain: 0.0 };
                    let [by_view, _] = pursuit_gain(&ground, &[0; 3 * 256], &c, &fit, 0.0);
                    let (a, b) = (DVec3::new(x[0], x[1], x[2]), DVec3::new(x[3], x[4], x[5]));
                    let o2 = opacity * opacity;
                    let by_sums = 2.0 * color.dot(opacity * a + o2 * b)
                        - color.length_squared() * o2 * x[6]
                        - 2.0 * opacity * x[7]
                        - o2 * x[8];
                    assert!((by_view - by_sums).abs() < 1e-9, "{size} {w}: {by_view} {by_sums}");
                }
                // Narrow lobes reach fewer views.
                lobes += usize::from(w as u32 != WIDTHS - 1 && x[6] < 0.99 * sums[WIDTHS as usize - 1][6]);
            }
        }
        assert!(lobes >= 8, "{lobes}");
    }

    /// One view, a residual of (0.4, 0, 0) on black: a fit of opacity 0.5 and color (0.4, 0, 0) explains half of it.
    #[test]
    fn what_is_explained_is_gained_no_more() {
        let (views, plots, c) = scene();
        let texels = vec![Texel { difference: DVec3::X * 0.4, ..Default::default() }; TEXELS as usize];
        let ground =
            Ground { views: &views[..1], plots: &plots, surface_depths: &[2.0; 256], texels: &texels, range: (0, 1) };
        let fit =
            Fit { sigma: 0.1, opacity: 0.5, width: 0.0, color: DVec3::X * 0.4, gain: 1.0, support: 1.0, plain: 0.0 };
        let mut explained = vec![0; 256];
        let before = pursuit_gain(&ground, &explained, &c, &fit, 0.0)[0];
        // s² = (0.1 · 20 / 2)² + 0.3 px². A uniform residual of 0.4 is that of a footprint that is 0.8 in the
        // middle; a quarter is explained.
        assert!((before - PI * 1.3 * (0.8f64.powi(2) - 0.6f64.powi(2))).abs() < 1e-12, "{before}");
        pursuit_attenuate(&ground, &c, &fit, &mut explained);
        assert_eq!(explained[c.pixel as usize], WHOLE as u32 / 4);
        let after = pursuit_gain(&ground, &explained, &c, &fit, 0.0)[0];
        assert!((after - PI * 1.3 * (0.6f64.powi(2) - 0.4f64.powi(2))).abs() < 1e-12, "{after}");
        // Two pixels beside; beyond 2.5 s = 2.85 px, so from 4 px on, nothing is explained.
        let beside = 0.25 * WHOLE * (-2.0f64 / 1.3).exp();
        assert!((f64::from(explained[c.pixel as usize + 2]) - beside).abs() <= 0.5);
        assert!(explained[c.pixel as usize + 3] > 0 && explained[c.pixel as usize + 4] == 0);
        assert_eq!(explained.iter().filter(|&&e| e > 0).count(), 49);
        // Four of them explain all; the fifth makes it worse.
        (0..3).for_each(|_| pursuit_attenuate(&ground, &c, &fit, &mut explained));
        assert_eq!(explained[c.pixel as usize], WHOLE as u32);
        let fifth = pursuit_gain(&ground, &explained, &c, &fit, 0.0)[0];
        assert!((fifth + PI * 1.3 * 0.2f64.powi(2)).abs() < 1e-12, "{fifth}");
        // A change in the wrong direction explains nothing, though it is a loss.
        let worse = Fit { color: DVec3::Y, ..fit };
        let mut same = explained.clone();
        pursuit_attenuate(&ground, &c, &worse, &mut same);
        assert!(same == explained && pursuit_gain(&ground, &[0; 256], &c, &worse, 0.0)[0] < 0.0);
    }

    /// A gain is the decrease of the squared error of the image under the Gaussian, including the texture
    /// that it hides.
    #[test]
    fn a_gain_is_the_fall_of_the_squared_error() {
        const SIDE: u32 = 64;
        let (f, middle) = (40.0, f64::from(SIDE) / 2.0);
        let view = View::from_camera(&Camera::new(SIDE, SIDE, f));
        let depth = 2.0;
        // A checkerboard of light and dark pixels, with a residual that depends on it.
        let board = |i: u32| if (i % SIDE + i / SIDE).is_multiple_of(2) { 1.0 } else { -1.0 };
        let (mean_r, mean_b) = (DVec3::new(0.05, -0.03, 0.02), DVec3::new(0.5, 0.4, 0.6));
        let image: Vec<Texel> = (0..SIDE * SIDE)
            .map(|i| Texel {
                difference: mean_r - DVec3::splat(0.01 * board(i)),
                render: mean_b + DVec3::splat(0.2 * board(i)),
                ..Default::default()
            })
            .collect();
        let mut texels = pursuit_blur(&image, [SIDE; 2], [SIDE; 2], false);
        let mut from = texels.clone();
        for k in 1..3 {
            from = pursuit_blur(&from, [SIDE >> (k - 1); 2], [SIDE >> k; 2], true);
            texels.extend(&from);
        }
        let plot = Plot { texel_first: 0, pixel_first: 0, cell_first: 0, block_first: 0 };
        let depths = vec![depth; (SIDE * SIDE) as usize];
        let ground = Ground { views: &[view], plots: &[plot], surface_depths: &depths, texels: &texels, range: (0, 1) };
        let at = DVec2::splat(middle + 0.5);
        let mean = DVec3::new(0.5 / f * depth, 0.5 / f * depth, depth);
        let (pixel, toward) = (SIDE * SIDE / 2 + SIDE / 2, -mean.normalize());
        let c = Candidate { mean, toward, px: depth / f, theta_bar: 0.1, view: 0, pixel };
        for deviation in [1.4, 2.8] {
            for (opacity, color, gains) in [
                (0.1, mean_b + 5.0 * mean_r, true),
                (0.6, mean_b + mean_r, false),
                (0.9, DVec3::new(0.9, 0.1, 0.4), false),
            ] {
                let sigma = (deviation * deviation - DILATION).sqrt() * c.px;
                let fit = Fit { sigma, opacity, width: 0.0, color, gain: 1.0, support: 1.0, plain: 0.0 };
                let [found, _] = pursuit_gain(&ground, &vec![0; depths.len()], &c, &fit, 0.0);
                let fall = |i: u32| {
                    let d = DVec2::new(f64::from(i % SIDE), f64::from(i / SIDE)) + 0.5 - at;
                    let alpha = opacity * (-0.5 * d.length_squared() / (deviation * deviation)).exp();
                    let t = &image[i as usize];
                    t.difference.length_squared() - (t.difference - alpha * (color - t.render)).length_squared()
                };
                let fell: f64 = (0..SIDE * SIDE).map(fall).sum();
                // A checkerboard's mean under 1.4 px is its own mean to within 1e-4; under the squared
                // weights, 1 px, to within 1 %.
                let scale = PI * deviation * deviation * (opacity * opacity * 0.12 + opacity * 0.04);
                assert!((found - fell).abs() < 0.03 * scale, "{deviation} {opacity}: {found} {fell}");
                assert_eq!(fell > 0.0, gains, "{deviation} {opacity}: {fell}");
            }
        }
    }

    /// Interpolates between four texels, weighted by their overlap.
    #[test]
    fn a_look_is_between_four_texels() {
        let (views, plots, _) = scene();
        let mut texels = vec![Texel::default(); TEXELS as usize];
        texels[5 * 16 + 3].render = DVec3::X;
        // Levels begin at 0, 256 and 320: the second of half the size.
        texels[256 + 2 * 8 + 1].render = DVec3::X;
        let ground = Ground { views: &views, plots: &plots, surface_depths: &[], texels: &texels, range: (0, 1) };
        let red = |x, y, deviation| ground.look(0, DVec2::new(x, y), deviation).render.x;
        assert_eq!(
            [red(3.5, 5.5, 0.7), red(3.75, 5.5, 0.7), red(3.0, 6.0, 0.9), red(4.5, 5.5, 0.7)],
            [1.0, 0.75, 0.25, 0.0]
        );
        // Texel (1, 2) of the next level is pixels 2 to 4, 4 to 6. The levels meet at 0.7 times the square root of 2.
        assert_eq!([red(3.0, 5.0, 1.0), red(4.0, 5.0, 1.9), red(3.5, 5.5, 0.98)], [1.0, 0.5, 1.0]);
    }
}

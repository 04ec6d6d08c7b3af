//! Twin of `screen_project.comp`: makes splats from the 2D Gaussians of one view, and takes their depths from
//! its depth map (method, section 3).
//!
//! gaussians, depths → gaussians (depth), splats, depths to sort by, tile counts. One iteration is one thread of the kernel.

use super::project::Projected;
use super::tiles::{Tiling, for_each_tile};
use super::{ALPHA_MIN, DILATION, Options, Splat, sigmoid};

/// 0,1 centre (px); 2..4 rgb; 5 opacity logit; 6,7 log scale (px); 8 angle (rad); 9 depth (camera z, 0: none).
pub type ScreenGaussian = [f64; 10];
/// First plane of the centre, x and y.
/// First plane of the color, r, g and b.
pub const COLOR: usize = 2;
/// Plane of the opacity's logit.
pub const LOGIT: usize = 5;
/// First plane of the two log scales.
pub const LOG_SCALE: usize = 6;
/// Plane of the angle.
pub const ANGLE: usize = 8;
/// Plane of the depth, which is not learned.
pub const DEPTH: usize = 9;

/// Projects them. `depths` is camera z by pixel, row-major. Only the tile sizes of `options` matter. The
/// result's depths are `f64::MAX` for Gaussians without a depth (behind everything), ∞ if the Gaussian is not
/// visible.
pub fn screen_project(
    gaussians: &mut [ScreenGaussian],
    depths: &[f64],
    width: u32,
    height: u32,
    options: &Options,
) -> Projected {
    let tiling = Tiling::new(width, height, options);
    let mut out = Projected {
        splats: vec![Splat::default(); gaussians.len()],
        depths: vec![f64::INFINITY; gaussians.len()],
        tile_counts: vec![0; gaussians.len()],
        kinks: vec![0; gaussians.len()],
    };
    for (i, gaussian) in gaussians.iter_mut().enumerate() {
        // Steps keep centres in the image; a NaN centre has no pixel.
        if !(gaussian[0] >= 0.0 && gaussian[1] >= 0.0 && gaussian[0] <= width as f64 && gaussian[1] <= height as f64) {
            continue;
        }
        let column = gaussian[0].clamp(0.0, width as f64 - 0.5) as usize;
        let row = gaussian[1].clamp(0.0, height as f64 - 0.5) as usize;
        let z = depths[row * width as usize + column];
        gaussian[DEPTH] = if z > 0.0 { z } else { 0.0 };
        let shape = Shape::new([gaussian[LOG_SCALE], gaussian[LOG_SCALE + 1]], gaussian[ANGLE]);
        let splat = Splat {
            x: gaussian[0],
            y: gaussian[1],
            l11: shape.l11,
            l12: shape.l12,
            l22: shape.l22,
            opacity: sigmoid(gaussian[LOGIT]) * shape.compensation,
            r: gaussian[2],
            g: gaussian[3],
            b: gaussian[4],
            z: gaussian[DEPTH],
        };
        if !(splat.opacity >= ALPHA_MIN && (splat.r + splat.g + splat.b).is_finite()) {
            continue;
        }
        let mut tiles = 0;
        for_each_tile(&splat, &tiling, |_| tiles += 1);
        if tiles == 0 {
            continue;
        }
        out.splats[i] = splat;
        out.depths[i] = if gaussian[DEPTH] > 0.0 { gaussian[DEPTH] } else { f64::MAX };
        out.tile_counts[i] = tiles;
    }
    out
}

/// The ellipse of a 2D Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Undilated, along the axes (cosine, sine) and (−sine, cosine), px².
    pub variance: [f64; 2],
    /// Cosine of the angle.
    pub cosine: f64,
    /// Sine of the angle.
    pub sine: f64,
    /// Factor of (S + 0.3 I)⁻¹ = LᵀL.
    pub l11: f64,
    /// Entry of L, 1/px.
    pub l12: f64,
    /// Entry of L, 1/px.
    pub l22: f64,
    /// √(det S / det(S + 0.3 I)).
    pub compensation: f64,
}

impl Shape {
    /// The ellipse of log scales in px and an angle in radians.
    pub fn new(log_scale: [f64; 2], angle: f64) -> Self {
        let variance = log_scale.map(|l| (2.0 * l).exp());
        let (sine, cosine) = angle.sin_cos();
        let [v, w] = variance.map(|v| v + DILATION);
        let det = v * w;
        let b = cosine * sine * (variance[0] - variance[1]);
        let c = sine * sine * v + cosine * cosine * w;
        Shape {
            variance,
            cosine,
            sine,
            l11: (c / det).sqrt(),
            l12: -b / (c * det).sqrt(),
            l22: 1.0 / c.sqrt(),
            compensation: (variance[0] / v * (variance[1] / w)).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::lift_count::screen_covariance;

    #[test]
    fn the_factor_is_that_of_the_dilated_covariance() {
        for (log_scale, angle) in [([1.0, -0.5], 0.7), ([0.0, 3.0], -2.0), ([-3.0, 2.0], 1.5), ([1.2, 1.2], 0.1)] {
            let e = Shape::new(log_scale, angle);
            let [a, b, c] = screen_covariance(log_scale, angle);
            // LᵀL (S + 0.3 I) = I.
            let q = [e.l11 * e.l11, e.l11 * e.l12, e.l12 * e.l12 + e.l22 * e.l22];
            let s = [a + 0.3, b, c + 0.3];
            for (x, expected) in [
                (q[0] * s[0] + q[1] * s[1], 1.0),
                (q[0] * s[1] + q[1] * s[2], 0.0),
                (q[1] * s[0] + q[2] * s[1], 0.0),
                (q[1] * s[1] + q[2] * s[2], 1.0),
            ] {
                assert!((x - expected).abs() < 1e-10);
            }
            let k = ((a * c - b * b) / (s[0] * s[2] - b * b)).sqrt();
            assert!((e.compensation - k).abs() < 1e-9);
        }
    }
}

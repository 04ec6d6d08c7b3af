//! Lens distortion: the Brown–Conrady model of OpenCV and COLMAP, and taking it out of an image.

use super::images::Pixels;

/// Coefficients as OpenCV names them. They act on normalised coordinates (x/z, y/z), so an image's size does not enter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distortion {
    pub k1: f64,
    pub k2: f64,
    pub k3: f64,
    pub p1: f64,
    pub p2: f64,
}

impl Distortion {
    pub fn is_none(&self) -> bool {
        *self == Distortion::default()
    }

    pub(super) fn is_finite(&self) -> bool {
        [self.k1, self.k2, self.k3, self.p1, self.p2].iter().all(|v| v.is_finite())
    }

    /// Where the lens puts the ray that a pinhole would see at (x, y), and whether the model can be believed there: beyond
    /// the radius at which it folds back onto itself (the determinant of its Jacobian is no longer positive) it cannot.
    pub fn apply(&self, x: f64, y: f64) -> ((f64, f64), bool) {
        let Distortion { k1, k2, k3, p1, p2 } = *self;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let distorted = (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        // ∂radial/∂x = x · slope, ∂radial/∂y = y · slope.
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3));
        let xx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
        let xy = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
        let yy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
        (distorted, xx * yy - xy * xy > 0.0 && radial > 0.0)
    }
}

/// A photo's own camera before undistortion, pixels of the image file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    pub width: u32,
    pub height: u32,
    pub fx: f64,
    pub fy: f64,
    pub cx: f64,
    pub cy: f64,
    pub distortion: Distortion,
}

impl Lens {
    /// The source position of the output position (x, y), both in pixels with centres at +0.5, and whether it lies in the
    /// image. The output is a pinhole camera of the same size, focal lengths and principal point.
    fn source(&self, x: f64, y: f64) -> ((f64, f64), bool) {
        let ((u, v), sound) = self.distortion.apply((x - self.cx) / self.fx, (y - self.cy) / self.fy);
        let (x, y) = (self.fx * u + self.cx, self.fy * v + self.cy);
        let inside = (0.0..=self.width as f64).contains(&x) && (0.0..=self.height as f64).contains(&y);
        ((x, y), sound && inside)
    }

    /// The part of the undistorted image, 0 to 1, that this image does not show: it is filled from the nearest edge.
    /// Found on at most 128 × 128 pixels spread evenly, so to about 1 % of the image's width.
    pub fn outside_fraction(&self) -> f64 {
        let (columns, rows) = (self.width.clamp(1, 128), self.height.clamp(1, 128));
        let mut outside = 0u32;
        for j in 0..rows {
            for i in 0..columns {
                let x = (i as f64 + 0.5) * self.width as f64 / columns as f64;
                let y = (j as f64 + 0.5) * self.height as f64 / rows as f64;
                outside += !self.source(x, y).1 as u32;
            }
        }
        outside as f64 / (columns * rows) as f64
    }

    /// The image as a pinhole camera would have taken it: each output pixel is sampled bilinearly, clamped to the edge.
    pub(super) fn undistort(&self, image: &Pixels) -> Pixels {
        let mut out = Vec::with_capacity(image.rgb.len());
        for row in 0..image.height {
            for column in 0..image.width {
                let ((x, y), _) = self.source(column as f64 + 0.5, row as f64 + 0.5);
                out.push(image.sample(x, y));
            }
        }
        Pixels { width: image.width, height: image.height, rgb: out }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOX: Distortion = Distortion { k1: 0.0578421, k2: -0.0805099, k3: 0.01, p1: -0.000980296, p2: 0.00015575 };

    fn lens(distortion: Distortion) -> Lens {
        Lens { width: 64, height: 48, fx: 60.0, fy: 62.0, cx: 33.0, cy: 23.5, distortion }
    }

    #[test]
    fn the_model_is_opencvs() {
        // By hand at (0.5, -0.25), r² = 0.3125.
        let ((x, y), sound) = FOX.apply(0.5, -0.25);
        let radial = 1.0 + 0.0578421 * 0.3125 - 0.0805099 * 0.3125f64.powi(2) + 0.01 * 0.3125f64.powi(3);
        assert!((x - (0.5 * radial + 2.0 * -0.000980296 * -0.125 + 0.00015575 * (0.3125 + 0.5))).abs() < 1e-15);
        assert!((y - (-0.25 * radial + -0.000980296 * (0.3125 + 0.125) + 2.0 * 0.00015575 * -0.125)).abs() < 1e-15);
        assert!(sound);
    }

    #[test]
    fn soundness_is_the_sign_of_the_jacobian() {
        let fold = Distortion { k1: -0.3, ..Default::default() };
        // x (1 − 0.3 x²) turns at x = 1 / √0.9.
        let turn = 1.0 / 0.9f64.sqrt();
        assert!(fold.apply(turn - 1e-6, 0.0).1);
        assert!(!fold.apply(turn + 1e-6, 0.0).1);
        for (x, y) in [(0.3, 0.2), (-0.7, 0.4), (0.1, -0.9)] {
            let h = 1e-6;
            let at = |x, y| FOX.apply(x, y).0;
            let (a, b, c, d) = (at(x + h, y), at(x - h, y), at(x, y + h), at(x, y - h));
            let det = ((a.0 - b.0) * (c.1 - d.1) - (a.1 - b.1) * (c.0 - d.0)) / (4.0 * h * h);
            assert_eq!(FOX.apply(x, y).1, det > 0.0);
        }
    }

    #[test]
    fn no_distortion_changes_nothing() {
        let rgb = (0..64 * 48).map(|i| [i as f32 * 1e-4, 0.5, 1.0 - i as f32 * 1e-4]).collect();
        let image = Pixels { width: 64, height: 48, rgb };
        let same = lens(Distortion::default()).undistort(&image);
        for (a, b) in same.rgb.iter().zip(&image.rgb) {
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-6));
        }
        assert_eq!(lens(Distortion::default()).outside_fraction(), 0.0);
    }

    #[test]
    fn a_distorted_picture_of_a_smooth_function_becomes_the_function() {
        // The lens sees f(ray); its image at the distorted position must come back to the undistorted one.
        let lens = lens(Distortion { k1: -0.15, k2: 0.04, p1: 0.004, p2: -0.003, k3: 0.0 });
        let f = |x: f64, y: f64| {
            [(0.5 + 0.4 * (2.0 * x).sin()) as f32, (0.5 + 0.4 * (1.5 * y).cos()) as f32, (0.5 + 0.3 * x * y) as f32]
        };
        let mut rgb = Vec::new();
        for j in 0..48 {
            for i in 0..64 {
                let (u, v) = ((i as f64 + 0.5 - lens.cx) / lens.fx, (j as f64 + 0.5 - lens.cy) / lens.fy);
                // The inverse by fixed-point iteration.
                let (mut x, mut y) = (u, v);
                for _ in 0..100 {
                    let ((dx, dy), _) = lens.distortion.apply(x, y);
                    (x, y) = (x + u - dx, y + v - dy);
                }
                rgb.push(f(x, y));
            }
        }
        let out = lens.undistort(&Pixels { width: 64, height: 48, rgb });
        let mut worst = 0.0f32;
        for j in 0..48 {
            for i in 0..64 {
                let (x, y) = (i as f64 + 0.5, j as f64 + 0.5);
                if lens.source(x, y).1 {
                    let truth = f((x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy);
                    let got = out.rgb[j * 64 + i];
                    worst = (0..3).map(|c| (got[c] - truth[c]).abs()).fold(worst, f32::max);
                }
            }
        }
        // Bilinear error is h²/8 · f'' = (1/60)²/8 · 1.6 = 6e-5; half a pixel of edge clamping adds at most 0.8/120 = 7e-3.
        assert!(worst < 7e-3, "{worst}");
    }

    #[test]
    fn what_the_image_does_not_show_is_counted() {
        // Scaling by 2 about the centre: only the middle quarter of the output lies in the image.
        let lens = Lens { fx: 1e3, fy: 1e3, cx: 32.0, cy: 24.0, ..lens(Distortion::default()) };
        assert_eq!(lens.outside_fraction(), 0.0);
        let pincushion = Lens { distortion: Distortion { k1: 1e3, ..Default::default() }, ..lens };
        // |x| (1 + 1000 r²) > edge in the corners only: r² ≥ 0 adds at most 1000 · 0.0016 = 1.6 times.
        let outside = pincushion.outside_fraction();
        assert!(outside > 0.2 && outside < 0.7, "{outside}");
    }
}

//! Camera models of COLMAP, OpenCV and nerfstudio, and their removal from photos.
//!
//! Models and their parameters: <https://colmap.github.io/cameras.html>. Rays are in camera axes (x right, y down, z forward);
//! pixel centres lie at +0.5.

use glam::{DMat2, DMat3, DVec2, DVec3};

/// How a lens maps rays to its image, before focal length and principal point. Nothing here depends on the image's size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distortion {
    /// Radial and tangential polynomials: OpenCV's, COLMAP's, fisheyes.
    Polynomial(Polynomial),
    /// Devernay and Faugeras 2001: the distance from the middle is atan(2 r tan(ω/2)) / ω.
    Fov {
        /// ω, radians.
        omega: f64,
    },
    /// Fitzgibbon 2001: r = r' / (1 + k r'²), with r' the distance in the image.
    Division {
        /// Coefficient of r'², r' relative to the focal length.
        k: f64,
    },
    /// Khomutenko et al. 2016, the enhanced unified camera model.
    Unified {
        /// Weight of the distance from the centre of projection in the depth, 0 to 1.
        alpha: f64,
        /// Weight of the lateral distance.
        beta: f64,
    },
    /// Longitude and latitude of the whole sphere, as fractions of a full and a half turn.
    Equirectangular,
}

/// Brown–Conrady distortion of x/z and y/z, or of the fisheye's angles. A pinhole if all coefficients are 0
/// and `fisheye` is false.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Polynomial {
    /// Project by the ray's angle from the axis, not by its tangent.
    pub fisheye: bool,
    /// The radius is multiplied by `(1 + Σ radial[i] r²⁽ⁱ⁺¹⁾) / (1 + Σ divisor[i] r²⁽ⁱ⁺¹⁾)`.
    pub radial: [f64; 6],
    /// See `radial`.
    pub divisor: [f64; 3],
    /// OpenCV's p1 and p2.
    pub tangential: [f64; 2],
    /// Adds `p[0] r² + p[1] r⁴` to x, `p[2] r² + p[3] r⁴` to y.
    pub prism: [f64; 4],
    /// Evaluate `tangential` and `prism` at the result of the radial part, not at the undistorted position.
    pub in_turn: bool,
}

impl Default for Distortion {
    fn default() -> Self {
        Distortion::Polynomial(Polynomial::default())
    }
}

/// A polynomial without its constant, Σ c[i] tⁱ⁺¹, and its derivative.
fn series(coefficients: &[f64], t: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for c in coefficients.iter().rev() {
        slope = slope * t + value + c;
        value = (value + c) * t;
    }
    (value, slope)
}

impl Polynomial {
    /// Factor of the radius, and its derivative by r².
    fn factor(&self, r2: f64) -> (f64, f64) {
        let ((n, dn), (d, dd)) = (series(&self.radial, r2), series(&self.divisor, r2));
        let (n, d) = (1.0 + n, 1.0 + d);
        (n / d, (dn * d - n * dd) / (d * d))
    }

    /// Image of (u, v), and the Jacobian.
    fn bend(&self, at: DVec2) -> (DVec2, DMat2) {
        let r2 = at.length_squared();
        let (factor, slope) = self.factor(r2);
        // ∂factor/∂u = 2 u · slope.
        let radial = DMat2::from_diagonal(DVec2::splat(factor)) + 2.0 * slope * DMat2::from_cols(at * at.x, at * at.y);
        let middle = at * factor;
        let p = if self.in_turn { middle } else { at };
        let (r2, [p1, p2]) = (p.length_squared(), self.tangential);
        let [x1, x2, y1, y2] = self.prism;
        let offset = DVec2::new(
            2.0 * p1 * p.x * p.y + p2 * (r2 + 2.0 * p.x * p.x) + x1 * r2 + x2 * r2 * r2,
            p1 * (r2 + 2.0 * p.y * p.y) + 2.0 * p2 * p.x * p.y + y1 * r2 + y2 * r2 * r2,
        );
        // Derivatives of the prism terms by r², times ∂r²/∂p = 2 p.
        let prism = DVec2::new(x1 + 2.0 * x2 * r2, y1 + 2.0 * y2 * r2);
        let by_x = DVec2::new(2.0 * p1 * p.y + 6.0 * p2 * p.x, 2.0 * p1 * p.x + 2.0 * p2 * p.y) + 2.0 * p.x * prism;
        let by_y = DVec2::new(2.0 * p1 * p.x + 2.0 * p2 * p.y, 6.0 * p1 * p.y + 2.0 * p2 * p.x) + 2.0 * p.y * prism;
        let offset_slope = DMat2::from_cols(by_x, by_y);
        let jacobian = if self.in_turn { radial + offset_slope * radial } else { radial + offset_slope };
        (middle + offset, jacobian)
    }

    /// The radius at which the radial part first folds back onto itself (r · factor stops growing), at most `farthest`.
    fn fold(&self, farthest: f64) -> f64 {
        let grows = |r: f64| {
            let (factor, slope) = self.factor(r * r);
            factor > 0.0 && factor + 2.0 * r * r * slope > 0.0
        };
        let steps = 4096;
        let at = |i: usize| farthest * i as f64 / steps as f64;
        let Some(first) = (1..=steps).find(|&i| !grows(at(i))) else { return farthest };
        let (mut low, mut high) = (at(first - 1), at(first));
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if grows(middle) { low = middle } else { high = middle }
        }
        low
    }
}

impl Distortion {
    /// OpenCV's common coefficients k1, k2, p1 and p2.
    pub fn opencv(k1: f64, k2: f64, p1: f64, p2: f64) -> Self {
        let radial = [k1, k2, 0.0, 0.0, 0.0, 0.0];
        Distortion::Polynomial(Polynomial { radial, tangential: [p1, p2], ..Default::default() })
    }

    /// A fisheye with up to four coefficients for the distortion of the angle.
    pub fn fisheye(k: [f64; 4]) -> Self {
        let radial = [k[0], k[1], k[2], k[3], 0.0, 0.0];
        Distortion::Polynomial(Polynomial { fisheye: true, radial, ..Default::default() })
    }

    /// Whether this is a pinhole.
    pub fn is_none(&self) -> bool {
        *self == Distortion::default()
    }

    /// Whether the lens maps angles, not tangents, to the image: such photos have no pinhole view of all they show.
    pub fn is_fisheye(&self) -> bool {
        matches!(self, Distortion::Polynomial(Polynomial { fisheye: true, .. }))
    }

    pub(super) fn is_finite(&self) -> bool {
        match self {
            Distortion::Polynomial(Polynomial { radial, divisor, tangential, prism, .. }) => {
                radial.iter().chain(divisor).chain(tangential).chain(prism).all(|v| v.is_finite())
            }
            Distortion::Fov { omega } => omega.is_finite(),
            Distortion::Division { k } => k.is_finite(),
            Distortion::Unified { alpha, beta } => alpha.is_finite() && beta.is_finite(),
            Distortion::Equirectangular => true,
        }
    }

    /// The radius beyond which [`Distortion::apply`] returns `None`: of the tangent or, for a fisheye, of the
    /// angle.
    fn reach(&self) -> f64 {
        match self {
            // A tangent of 100 is 89.4°.
            Distortion::Polynomial(p) => p.fold(if p.fisheye { std::f64::consts::PI } else { 100.0 }),
            _ => f64::INFINITY,
        }
    }

    /// Maps a ray to the image. `None` if the model is invalid there: behind a lens that does not see
    /// backward, and beyond the radius at which it folds back onto itself. `reach` is [`Distortion::reach`].
    fn apply(&self, ray: DVec3, reach: f64) -> Option<DVec2> {
        let DVec3 { x, y, z } = ray;
        let across = ray.truncate();
        match *self {
            Distortion::Polynomial(polynomial) => {
                let at = if polynomial.fisheye {
                    let r = across.length();
                    // In the limit, angle and tangent are equal.
                    let scale = if r > 0.0 { r.atan2(z) / r } else { 1.0 / z };
                    across * scale
                } else {
                    across / z
                };
                let inside = (z > 0.0 || polynomial.fisheye) && at.length_squared() < reach * reach;
                let (to, jacobian) = polynomial.bend(at);
                (inside && jacobian.determinant() > 0.0).then_some(to)
            }
            Distortion::Fov { omega } => {
                let at = across / z;
                let (r, slope) = (at.length(), 2.0 * (0.5 * omega).tan());
                let scale = if omega == 0.0 {
                    1.0
                } else if r * slope.abs() < 1e-6 {
                    slope / omega
                } else {
                    (r * slope).atan() / (r * omega)
                };
                (z > 0.0).then_some(at * scale)
            }
            Distortion::Division { k } => {
                // r k r'² − r' + r = 0: the root that equals r for k = 0.
                let root = z * z - 4.0 * k * across.length_squared();
                (z > 0.0 && root > 0.0).then(|| across * (2.0 / (z + root.sqrt())))
            }
            Distortion::Unified { alpha, beta } => {
                let depth = alpha * (beta * across.length_squared() + z * z).sqrt() + (1.0 - alpha) * z;
                (z > 0.0 && depth > 0.0).then(|| across / depth)
            }
            Distortion::Equirectangular => {
                let (longitude, latitude) = (x.atan2(z), y.atan2(x.hypot(z)));
                Some(DVec2::new(longitude / std::f64::consts::TAU, latitude / std::f64::consts::PI))
            }
        }
    }
}

/// Size, focal lengths and principal point, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Focal lengths, px.
    pub fx: f64,
    /// Focal length, px.
    pub fy: f64,
    /// Principal point, px from the upper left corner.
    pub cx: f64,
    /// Principal point, px.
    pub cy: f64,
}

/// A photo's own camera, and the pinhole camera of the prepared picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Intrinsics of the image file.
    pub file: Frame,
    /// Distortion from a ray to its position in the file.
    pub distortion: Distortion,
    /// Intrinsics of the picture before downscaling.
    pub view: Frame,
    /// Rotation from the view's rays to the file's.
    pub turn: DMat3,
    reach: f64,
}

impl Lens {
    /// The picture keeps the file's size, focal lengths and principal point.
    pub fn new(file: Frame, distortion: Distortion) -> Lens {
        Lens { file, distortion, view: file, turn: DMat3::IDENTITY, reach: distortion.reach() }
    }

    /// The six faces of the cube around an equirectangular image, with their names. The middle of a face has
    /// the image's pixels per radian.
    pub fn cube(file: Frame) -> [(&'static str, Lens); 6] {
        let side = (file.width as f64 / std::f64::consts::PI).round().max(1.0);
        let half = 0.5 * side;
        let view = Frame { width: side as u32, height: side as u32, fx: half, fy: half, cx: half, cy: half };
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
        let faces =
            [("front", x, z), ("right", -z, x), ("back", -x, -z), ("left", z, -x), ("up", x, -y), ("down", x, y)];
        faces.map(|(name, right, forward)| {
            let turn = DMat3::from_cols(right, forward.cross(right), forward);
            (name, Lens { file, distortion: Distortion::Equirectangular, view, turn, reach: f64::INFINITY })
        })
    }

    /// Position in the file of the view's position (x, y), and whether the file covers it.
    pub(super) fn source(&self, x: f64, y: f64) -> (DVec2, bool) {
        let Lens { file, view, .. } = self;
        let ray = self.turn * DVec3::new((x - view.cx) / view.fx, (y - view.cy) / view.fy, 1.0);
        let Some(at) = self.distortion.apply(ray, self.reach) else { return (DVec2::ZERO, false) };
        let at = DVec2::new(file.fx * at.x + file.cx, file.fy * at.y + file.cy);
        let inside = (0.0..=file.width as f64).contains(&at.x) && (0.0..=file.height as f64).contains(&at.y);
        (at, inside)
    }

    /// Fraction of the picture, 0 to 1, outside of the file. Sampled on at most 128 × 128 pixels spread
    /// evenly, so with an error of about 1 % of the picture's width.
    pub fn outside_fraction(&self) -> f64 {
        let (columns, rows) = (self.view.width.clamp(1, 128), self.view.height.clamp(1, 128));
        let at = |i: u32, of: u32, size: u32| (i as f64 + 0.5) * size as f64 / of as f64;
        let positions = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j)));
        let seen = |&(i, j): &(u32, u32)| self.source(at(i, columns, self.view.width), at(j, rows, self.view.height)).1;
        positions.filter(|p| !seen(p)).count() as f64 / (columns * rows) as f64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn frame(width: u32, height: u32, focal: f64) -> Frame {
        Frame { width, height, fx: focal, fy: 1.03 * focal, cx: 0.52 * width as f64, cy: 0.49 * height as f64 }
    }

    fn at(distortion: Distortion, u: f64, v: f64) -> Option<(f64, f64)> {
        distortion.apply(DVec3::new(u, v, 1.0), distortion.reach()).map(|to| (to.x, to.y))
    }

    /// One lens of each model, with realistic coefficients.
    fn lenses() -> Vec<Distortion> {
        let radial = [0.08, -0.03, 0.004, 0.0, 0.0, 0.0];
        let full =
            Polynomial { radial, divisor: [0.05, -0.01, 0.002], tangential: [1e-3, -2e-3], ..Default::default() };
        let thin = Polynomial {
            fisheye: true,
            radial: [-0.02, 0.003, 1e-3, -2e-4, 0.0, 0.0],
            tangential: [1e-3, -2e-3],
            prism: [3e-3, 0.0, -1e-3, 0.0],
            ..Default::default()
        };
        let turns = Polynomial {
            radial: [-0.02, 0.003, 1e-3, -2e-4, 1e-5, -1e-6],
            prism: [3e-3, 1e-4, -1e-3, 2e-4],
            in_turn: true,
            ..thin
        };
        vec![
            Distortion::default(),
            Distortion::opencv(-0.15, 0.04, 0.004, -0.003),
            Distortion::Polynomial(full),
            Distortion::fisheye([-0.01, 0.004, -0.002, 3e-4]),
            Distortion::Polynomial(thin),
            Distortion::Polynomial(turns),
            Distortion::Fov { omega: 0.9 },
            Distortion::Division { k: -0.2 },
            Distortion::Division { k: 0.1 },
            Distortion::Unified { alpha: 0.6, beta: 1.1 },
        ]
    }

    /// Values worked out by hand from the definitions in COLMAP's documentation and the papers that it cites.
    #[test]
    fn every_model_is_its_definition_at_a_point() {
        let near = |got: Option<(f64, f64)>, want: (f64, f64)| {
            let (x, y) = got.unwrap();
            assert!((x - want.0).abs() < 1e-12 && (y - want.1).abs() < 1e-12, "{x}, {y} for {want:?}");
        };
        // OpenCV's at (0.5, −0.25), r² = 0.3125.
        let (k, d, p1, p2) = ([0.0578421, -0.0805099, 0.01], [0.2, -0.1, 0.05], -9.8e-4, 1.6e-4);
        let [above, below] = [k, d].map(|k| 1.0 + k[0] * 0.3125 + k[1] * 0.3125f64.powi(2) + k[2] * 0.3125f64.powi(3));
        let radial = [k[0], k[1], k[2], 0.0, 0.0, 0.0];
        let full = Polynomial { radial, divisor: d, tangential: [p1, p2], ..Default::default() };
        let x = 0.5 * above / below + 2.0 * p1 * -0.125 + p2 * (0.3125 + 0.5);
        let y = -0.25 * above / below + p1 * (0.3125 + 0.125) + 2.0 * p2 * -0.125;
        near(at(Distortion::Polynomial(full), 0.5, -0.25), (x, y));
        // A ray of 45° to the right: tan 1, angle π/4.
        let angle = std::f64::consts::FRAC_PI_4;
        near(at(Distortion::fisheye([0.0; 4]), 1.0, 0.0), (angle, 0.0));
        let k = [0.1, -0.02, 0.003, -4e-4];
        let bent = 1.0 + 0.1 * angle.powi(2) - 0.02 * angle.powi(4) + 0.003 * angle.powi(6) - 4e-4 * angle.powi(8);
        near(at(Distortion::fisheye(k), 0.0, 1.0), (0.0, angle * bent));
        near(at(Distortion::Fov { omega: 1.0 }, 1.0, 0.0), ((2.0 * 0.5f64.tan()).atan(), 0.0));
        near(at(Distortion::Fov { omega: 0.0 }, 1.0, 0.5), (1.0, 0.5));
        near(at(Distortion::Fov { omega: 0.8 }, 0.0, 0.0), (0.0, 0.0));
        // r' = 0.5 with k = −0.4 is r = 0.5 / (1 − 0.4 / 4) = 5/9.
        near(at(Distortion::Division { k: -0.4 }, 5.0 / 9.0, 0.0), (0.5, 0.0));
        near(at(Distortion::Division { k: 0.0 }, 0.3, 0.4), (0.3, 0.4));
        // x² + y² = 0.25, β 4: depth is α √2 + (1 − α).
        let depth = 0.3 * 2.0f64.sqrt() + 0.7;
        near(at(Distortion::Unified { alpha: 0.3, beta: 4.0 }, 0.3, 0.4), (0.3 / depth, 0.4 / depth));
        near(at(Distortion::Unified { alpha: 0.0, beta: 1.0 }, 0.3, 0.4), (0.3, 0.4));
        near(at(Distortion::Equirectangular, 1.0, 0.0), (0.125, 0.0));
        near(at(Distortion::Equirectangular, 0.0, -1.0), (0.0, -0.25));
        let prism = Polynomial { fisheye: true, prism: [0.1, 0.01, 0.2, 0.02], ..Default::default() };
        let (r2, r4) = (angle.powi(2), angle.powi(4));
        let want = (angle + 0.1 * r2 + 0.01 * r4, 0.2 * r2 + 0.02 * r4);
        near(at(Distortion::Polynomial(prism), 1.0, 0.0), want);
        // In turn: the added terms use the radius after the radial part.
        let turns = Polynomial { radial: [0.5, 0.0, 0.0, 0.0, 0.0, 0.0], in_turn: true, ..prism };
        let x = angle * (1.0 + 0.5 * r2);
        let want = (x + 0.1 * x.powi(2) + 0.01 * x.powi(4), 0.2 * x.powi(2) + 0.02 * x.powi(4));
        near(at(Distortion::Polynomial(turns), 1.0, 0.0), want);
    }

    #[test]
    fn a_lens_ends_where_it_folds_and_does_not_begin_again() {
        // x (1 − 0.3 x²) turns at x = 1 / √0.9.
        let turn = 1.0 / 0.9f64.sqrt();
        let fold = Distortion::opencv(-0.3, 0.0, 0.0, 0.0);
        assert!(at(fold, turn - 1e-6, 0.0).is_some() && at(fold, turn + 1e-6, 0.0).is_none());
        // x (1 − x² + 0.25 x⁴) falls between x = √0.4 and √2 and then grows again, so a test of the slope
        // alone would accept it.
        let again = Distortion::opencv(-1.0, 0.25, 0.0, 0.0);
        assert!((again.reach() - 0.4f64.sqrt()).abs() < 1e-9);
        assert!(at(again, 0.6, 0.0).is_some() && at(again, 1.0, 0.0).is_none() && at(again, 1.6, 0.0).is_none());
        // The real root ends at 4 k r² = 1, so at r = 1.
        let division = Distortion::Division { k: 0.25 };
        assert!(at(division, 0.999, 0.0).is_some() && at(division, 1.001, 0.0).is_none());
        for lens in lenses().into_iter().filter(|lens| !lens.is_fisheye()) {
            assert!(lens.apply(DVec3::new(0.1, 0.1, -1.0), lens.reach()).is_none(), "{lens:?}");
        }
        let behind = Distortion::fisheye([0.0; 4]).apply(DVec3::new(1.0, 0.0, -1.0), std::f64::consts::PI).unwrap();
        assert!((behind.x - 0.75 * std::f64::consts::PI).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn the_jacobian_is_the_slope(which in 0..10usize, u in -0.9..0.9f64, v in -0.9..0.9f64) {
            if let Distortion::Polynomial(polynomial) = lenses()[which] {
                let h = 1e-6;
                let bend = |x, y| polynomial.bend(DVec2::new(x, y)).0;
                let by_x = (bend(u + h, v) - bend(u - h, v)) / (2.0 * h);
                let by_y = (bend(u, v + h) - bend(u, v - h)) / (2.0 * h);
                let jacobian = polynomial.bend(DVec2::new(u, v)).1;
                // Truncation is h² and rounding 1e-16 / h.
                prop_assert!((jacobian.x_axis - by_x).length() < 1e-8 && (jacobian.y_axis - by_y).length() < 1e-8);
            }
        }

        /// A straight line through the middle stays one in a radial lens, every lens keeps the order of angles, and
        /// a ray has no length.
        #[test]
        fn farther_rays_lie_farther_out(which in 0..10usize, turn in 0.0..std::f64::consts::TAU, r in 0.01..0.8f64) {
            let lens = lenses()[which];
            let ray = |r: f64| DVec3::new(r * turn.cos(), r * turn.sin(), 1.0);
            let [near, far, long] = [ray(r), ray(1.01 * r), 2.5 * ray(r)].map(|ray| lens.apply(ray, lens.reach()).unwrap());
            prop_assert!(near.length() < far.length() && near.dot(far) > 0.0);
            // A few roundings of float64.
            prop_assert!(near.distance(long) < 1e-12);
        }
    }

    #[test]
    fn what_the_image_does_not_show_is_counted() {
        let file = Frame { width: 64, height: 48, fx: 1e3, fy: 1e3, cx: 32.0, cy: 24.0 };
        let pincushion = Lens::new(file, Distortion::opencv(1e3, 0.0, 0.0, 0.0));
        // |x| (1 + 1000 r²) > edge in the corners only: r² ≥ 0 adds at most 1000 · 0.0016 = 1.6 times.
        let outside = pincushion.outside_fraction();
        assert!(outside > 0.2 && outside < 0.7, "{outside}");
        // A fisheye of the same focal length covers everything that a pinhole does.
        assert_eq!(Lens::new(frame(64, 48, 20.0), Distortion::fisheye([0.0; 4])).outside_fraction(), 0.0);
    }

    /// Each face looks in the direction of its name, neighbours meet at their edges, and no ray is mirrored.
    #[test]
    fn the_faces_of_a_cube_cover_the_sphere() {
        let file = Frame { width: 200, height: 100, fx: 200.0, fy: 100.0, cx: 100.0, cy: 50.0 };
        let faces = Lens::cube(file);
        let middle = |i: usize| faces[i].1.source(32.0, 32.0).0;
        assert!(faces.iter().all(|(_, lens)| (lens.turn.determinant() - 1.0).abs() < 1e-12));
        assert!(faces.iter().all(|(_, lens)| lens.outside_fraction() == 0.0));
        assert_eq!([0, 1, 3].map(middle), [100.0, 150.0, 50.0].map(|x| DVec2::new(x, 50.0)));
        assert!((middle(2).x - 200.0).abs() < 1e-9 || middle(2).x.abs() < 1e-9);
        assert_eq!((middle(4).y, middle(5).y), (0.0, 100.0));
        // The right edge of the front is the left edge of the right face, and so on; the upper edge of the
        // front is the lower edge of the face above.
        let same = |a: (usize, f64, f64), b: (usize, f64, f64)| {
            let (p, q) = (faces[a.0].1.source(a.1, a.2).0, faces[b.0].1.source(b.1, b.2).0);
            assert!((p - q).length() < 1e-9, "{p} {q}");
        };
        for y in [5.0, 32.0, 60.0] {
            same((0, 64.0, y), (1, 0.0, y));
            same((3, 64.0, y), (0, 0.0, y));
            same((0, y, 0.0), (4, y, 64.0));
            same((0, y, 64.0), (5, y, 0.0));
        }
    }
}

//! Twin of `glsl/shared/pursuit.glsl`: types and helpers of residual pursuit in float64.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use half::f16;

use super::{DILATION, NEAR, NONE, View};
use crate::stages::{
    constants::pursuit::{LEVELS, WIDTHS},
    types::{self, Plot},
};

pub(super) const FIRST_BLUR: f64 = 0.7;
pub(super) const NEXT_BLUR: f64 = 1.2124;
pub(crate) const REACH: f64 = 2.5;
pub(super) const CORE: f64 = 0.5;
pub(super) const WINDOW_SLACK: f64 = 1e-3;
pub(crate) const WHOLE: f64 = 65536.0;
pub(super) const WIDEST: f64 = 3.2;
pub(super) const SAME_DEPTH: f64 = 0.05;

/// Statistics of a view beneath a footprint, sRGB: means of photograph minus render and of the render, and
/// their covariance and variance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Texel {
    /// Photograph minus render; 0 if the pixel does not count.
    pub difference: DVec3,
    /// 0 to 1.
    pub render: DVec3,
    /// Covariance of difference and render, summed over channels.
    pub covariance: f64,
    /// Variance of the render, summed over channels.
    pub variance: f64,
}

impl Texel {
    /// Unpacks four words of two halves each.
    pub fn unpack(t: &types::Texel) -> Self {
        let halves = |word: u32| [word as u16, (word >> 16) as u16].map(|bits| f16::from_bits(bits).to_f64());
        let ([a, b], [c, d], [e, f]) = (halves(t.difference_rg), halves(t.difference_b_render_r), halves(t.render_gb));
        let [covariance, variance] = halves(t.texture);
        Texel { difference: DVec3::new(a, b, c), render: DVec3::new(d, e, f), covariance, variance }
    }

    /// Rounded to halves.
    pub fn pack(&self) -> types::Texel {
        let (d, r) = (self.difference, self.render);
        let word = |low: f64, high: f64| {
            let bits = |v: f64| u32::from(f16::from_f64(v).to_bits());
            bits(low) | bits(high) << 16
        };
        types::Texel {
            difference_rg: word(d.x, d.y),
            difference_b_render_r: word(d.z, r.x),
            render_gb: word(r.y, r.z),
            texture: word(self.covariance, self.variance),
        }
    }

    /// The eight numbers.
    pub fn values(&self) -> [f64; 8] {
        let (d, r) = (self.difference, self.render);
        [d.x, d.y, d.z, r.x, r.y, r.z, self.covariance, self.variance]
    }

    /// Adds another one, `weight` times.
    pub(super) fn add(&mut self, weight: f64, t: &Texel) {
        self.difference += weight * t.difference;
        self.render += weight * t.render;
        self.covariance += weight * t.covariance;
        self.variance += weight * t.variance;
    }
}

/// A drawn pixel's point on the surface that the scene shows there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// From the model's origin, scene units.
    pub mean: DVec3,
    /// Unit, to the camera of the view that it was drawn in.
    pub toward: DVec3,
    /// Scene units that a pixel covers at its depth, in the view that it was drawn in.
    pub px: f64,
    /// Angle to the nearest other training view, radians.
    pub theta_bar: f64,
    /// [`NONE`]: no candidate.
    pub view: u32,
    /// Pixel of that view, rows from the top.
    pub pixel: u32,
}

impl From<&types::Candidate> for Candidate {
    fn from(c: &types::Candidate) -> Self {
        let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        Candidate {
            mean: wide(c.mean),
            toward: wide(c.toward),
            px: c.px.into(),
            theta_bar: c.theta_bar.into(),
            view: c.view,
            pixel: c.pixel,
        }
    }
}

/// The best Gaussian found for a candidate.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Fit {
    /// Scene units.
    pub sigma: f64,
    /// 0 to 1.
    pub opacity: f64,
    /// T of the lobe; 0: no lobe.
    pub width: f64,
    /// sRGB.
    pub color: DVec3,
    /// 0: none.
    pub gain: f64,
    /// C of [`super::pursuit_score`].
    pub support: f64,
    /// Gain of the best fit without a lobe; 0: none.
    pub plain: f64,
}

impl From<&types::Fit> for Fit {
    fn from(f: &types::Fit) -> Self {
        Fit {
            sigma: f.sigma.into(),
            opacity: f.opacity.into(),
            width: f.width.into(),
            color: DVec3::from_array(f.color.map(f64::from)),
            gain: f.gain.into(),
            support: f.support.into(),
            plain: f.plain.into(),
        }
    }
}

/// A candidate as seen in one view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Pixels.
    pub at: DVec2,
    /// The pixel that contains `at`, rows from the top.
    pub pixel: u32,
    /// Camera z.
    pub z: f64,
    /// Angle between this camera and the camera that the candidate was drawn in.
    pub theta: f64,
}

/// The views of a page and their data.
#[derive(Debug, Clone, Copy)]
pub struct Ground<'a> {
    /// All training views.
    pub views: &'a [View],
    /// First texel, pixel, cell and block of each view.
    pub plots: &'a [Plot],
    /// Depths of the page's pixels.
    pub surface_depths: &'a [f64],
    /// Texels of the page; may be empty if no function reads them.
    pub texels: &'a [Texel],
    /// First view of the page, and end.
    pub range: (u32, u32),
}

impl Ground<'_> {
    /// `None` if the view does not see the candidate.
    pub fn sees(&self, v: u32, c: &Candidate) -> Option<Sight> {
        let view = &self.views[v as usize];
        let (at, z) = project_point(view, c.mean)?;
        let pixel = at.y as u32 * view.width + at.x as u32;
        let own = self.surface_depths[(self.plots[v as usize].pixel_first + pixel) as usize];
        if v != c.view && own > 0.0 && z - own >= SAME_DEPTH * own {
            return None;
        }
        let theta = if v == c.view { 0.0 } else { angle_between(c.toward, view.eye - c.mean) };
        Some(Sight { at, pixel, z, theta })
    }

    /// Every view of the page that sees the candidate.
    pub fn sights(&self, c: &Candidate) -> impl Iterator<Item = (u32, Sight)> {
        let (first, end) = if c.view == NONE { (0, 0) } else { self.range };
        (first..end).filter_map(|v| Some((v, self.sees(v, c)?)))
    }

    /// The view's statistics beneath a footprint of about `deviation` px.
    pub fn look(&self, v: u32, at: DVec2, deviation: f64) -> Texel {
        let view = &self.views[v as usize];
        let k = ((deviation / FIRST_BLUR).log2() + 0.5).floor().clamp(0.0, f64::from(LEVELS - 1)) as u32;
        let [first, width, height] = level_of(&self.plots[v as usize], view.width, view.height, k);
        let place = at / f64::from(1u32 << k) - 0.5;
        let (low, share) = (place.floor(), place - place.floor());
        let mut sum = Texel::default();
        for corner in 0..4u32 {
            let step = DVec2::new(f64::from(corner & 1), f64::from(corner >> 1));
            let most = DVec2::new(f64::from(width - 1), f64::from(height - 1));
            let texel = (low + step).clamp(DVec2::ZERO, most);
            let weights = (1.0 - share) * (1.0 - step) + share * step;
            let t = &self.texels[(first + texel.y as u32 * width + texel.x as u32) as usize];
            sum.add(weights.x * weights.y, t);
        }
        sum
    }

    /// A fit in one view: its α, the texel beneath it, and its deviation in pixels. `None` outside of its
    /// lobe.
    pub fn meets(&self, v: u32, s: &Sight, fit: &Fit) -> Option<(f64, Texel, f64)> {
        let alpha = fit.opacity * lobe_factor(s.theta, fit.width);
        let deviation = footprint_px(&self.views[v as usize], s.z, fit.sigma);
        (alpha > 0.0).then(|| (alpha, self.look(v, s.at, deviation), deviation))
    }

    /// The pixels within `px` of a candidate's pixel, rounded up to a whole number: first and last column and
    /// row, as [x, y, x, y].
    pub fn window(&self, v: u32, s: &Sight, px: f64) -> [u32; 4] {
        let View { width, height, .. } = self.views[v as usize];
        let (x, y, reach) = (s.pixel % width, s.pixel / width, (px - WINDOW_SLACK).ceil() as u32);
        [x.saturating_sub(reach), y.saturating_sub(reach), (x + reach).min(width - 1), (y + reach).min(height - 1)]
    }
}

/// The texels of level k of a view: first, width, height.
pub fn level_of(plot: &Plot, width: u32, height: u32, k: u32) -> [u32; 3] {
    let mut level = [plot.texel_first, width, height];
    for j in 1..=k {
        level = [level[0] + level[1] * level[2], width.div_ceil(1 << j), height.div_ceil(1 << j)];
    }
    level
}

/// Cosine lobe of sharpness 0; 1 for width 0.
pub fn lobe_factor(theta: f64, width: f64) -> f64 {
    if width == 0.0 {
        return 1.0;
    }
    let psi = theta / width;
    if psi < PI { 0.5 * (psi.cos() + 1.0) } else { 0.0 }
}

/// T of width w of [`WIDTHS`]; 0 for no lobe.
pub fn lobe_width(w: u32, theta_bar: f64) -> f64 {
    if w == WIDTHS - 1 { 0.0 } else { (2f64.powi(w as i32 - 1) * 7.0 * theta_bar / PI).clamp(0.01, 1.0) }
}

/// Standard deviation, in scene units, of a Gaussian that covers `size` px if a pixel covers `px` scene
/// units.
pub fn sigma_of(size: f64, px: f64) -> f64 {
    (size * size - DILATION).max(0.1).sqrt() * px
}

pub(super) fn angle_between(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Pixels and camera z of a point, if it is in the image.
pub(super) fn project_point(view: &View, mean: DVec3) -> Option<(DVec2, f64)> {
    let [x, y, z] = [view.row_x, view.row_y, view.row_z].map(|row| row.truncate().dot(mean) + row.w);
    if !(z > NEAR) {
        return None;
    }
    let at = DVec2::new(view.fx * x / z + view.cx, view.fy * y / z + view.cy);
    let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < f64::from(view.width) && at.y < f64::from(view.height);
    inside.then_some((at, z))
}

/// Standard deviation, in a view's pixels, of a round Gaussian of `sigma` scene units.
pub fn footprint_px(view: &View, z: f64, sigma: f64) -> f64 {
    let px = sigma * view.fx / z;
    (px * px + DILATION).sqrt().min(WIDEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_and_follow_each_other() {
        let plot = Plot { texel_first: 5, pixel_first: 0, cell_first: 0, block_first: 0 };
        assert_eq!([0, 1, 2].map(|k| level_of(&plot, 7, 3, k)), [[5, 7, 3], [26, 4, 2], [34, 2, 1]]);
    }

    #[test]
    fn lobes_double_from_half_the_papers_width() {
        let theta = 0.1;
        let paper = 7.0 * theta / PI;
        assert_eq!([0, 1, 2, 5].map(|w| lobe_width(w, theta)), [0.5 * paper, paper, 2.0 * paper, 0.0]);
        assert_eq!((lobe_width(4, 3.0), lobe_width(0, 1e-9)), (1.0, 0.01));
        assert_eq!((lobe_factor(0.0, 0.3), lobe_factor(0.3 * PI, 0.3), lobe_factor(9.0, 0.0)), (1.0, 0.0, 1.0));
    }
}

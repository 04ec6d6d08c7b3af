//! Twin of `lift_count.comp`: counts the pixels with a depth that each 2D Gaussian covers (method, section
//! 4.1). Also the footprint of a 2D Gaussian, shared with `lift_points`.

use super::{ALPHA_MAX, ALPHA_MIN, DILATION};
use crate::scene::Camera;

/// 2D Gaussians and their views, laid out as on the GPU.
#[derive(Debug, Clone, Copy)]
pub struct ScreenGaussians<'a> {
    /// 10 planes × `stride`: 0,1 centre (px), 2..4 rgb, 5 opacity logit, 6,7 log scale (px), 8 angle (rad), 9 depth (0: none).
    pub screen_planes: &'a [f64],
    /// Slots of a plane.
    pub stride: usize,
    /// View of each 2D Gaussian, [`super::NONE`] for an empty slot; its length is their number.
    pub screen_frames: &'a [u32],
    /// The views' cameras.
    pub views: &'a [Camera],
    /// First pixel of each view in `depths`.
    pub pixel_firsts: &'a [usize],
    /// Camera z of every pixel of every view, row-major; 0: none.
    pub depths: &'a [f64],
}

impl ScreenGaussians<'_> {
    /// Slots, including empty ones.
    pub fn len(&self) -> usize {
        self.screen_frames.len()
    }

    /// True if there are no slots.
    pub fn is_empty(&self) -> bool {
        self.screen_frames.is_empty()
    }

    /// One value of one 2D Gaussian; planes as in `screen_planes`.
    pub fn get(&self, plane: usize, item: usize) -> f64 {
        self.screen_planes[plane * self.stride + item]
    }

    /// The view of a 2D Gaussian, `None` for an empty slot.
    pub fn view(&self, item: usize) -> Option<&Camera> {
        self.views.get(self.screen_frames[item] as usize)
    }

    /// Camera z at a pixel of the 2D Gaussian's view; 0: none.
    pub fn depth(&self, item: usize, x: u32, y: u32) -> f64 {
        let v = self.screen_frames[item] as usize;
        self.depths[self.pixel_firsts[v] + (y * self.views[v].width + x) as usize]
    }

    /// S as (S11, S12, S22), px².
    pub fn covariance(&self, item: usize) -> [f64; 3] {
        screen_covariance([self.get(6, item), self.get(7, item)], self.get(8, item))
    }

    /// The pixels that it can cover; `None` for an empty slot and if there are none.
    pub fn footprint(&self, item: usize) -> Option<Footprint> {
        let camera = self.view(item)?;
        make_footprint(
            [self.get(0, item), self.get(1, item)],
            self.get(5, item),
            [self.get(6, item), self.get(7, item)],
            self.get(8, item),
            [camera.width, camera.height],
            false,
        )
    }
}

/// The pixels that a 2D Gaussian may cover, and the conic that weighs them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// Pixels.
    pub centre: [f64; 2],
    /// (S + 0.3 I)⁻¹ = LᵀL, L upper triangular.
    pub l11: f64,
    /// Entry of L, 1/px.
    pub l12: f64,
    /// Entry of L, 1/px.
    pub l22: f64,
    /// σ(logit), compensated or not.
    pub opacity: f64,
    /// First pixel of the bounding box.
    pub low: [u32; 2],
    /// Size of the bounding box, pixels.
    pub size: [u32; 2],
}

/// Rot(angle) diag(s²) Rot(angle)ᵀ as (S11, S12, S22).
pub fn screen_covariance(log_scale: [f64; 2], angle: f64) -> [f64; 3] {
    let [a, b] = log_scale.map(|l| (2.0 * l).exp());
    let (n, c) = angle.sin_cos();
    [c * c * a + n * n * b, c * n * (a - b), n * n * a + c * c * b]
}

/// The ellipse with α ≥ 1/255 of a 2D Gaussian in an image of `image` pixels; `None` if it covers no pixel.
pub fn make_footprint(
    centre: [f64; 2],
    logit: f64,
    log_scale: [f64; 2],
    angle: f64,
    image: [u32; 2],
    compensate: bool,
) -> Option<Footprint> {
    let s = screen_covariance(log_scale, angle);
    let [v, w] = log_scale.map(|l| (2.0 * l).exp());
    let (a, c) = (s[0] + DILATION, s[2] + DILATION);
    let whole = v * w + DILATION * (v + w) + DILATION * DILATION;
    let compensation = if compensate { (v * w / whole).sqrt() } else { 1.0 };
    let opacity = compensation / (1.0 + (-logit).exp());
    let visible = opacity >= ALPHA_MIN && whole.is_finite() && centre.iter().all(|x| x.abs() <= 1e9);
    if !visible {
        return None;
    }
    let mut low = [0; 2];
    let mut size = [0; 2];
    for k in 0..2 {
        let reach = (2.0 * (255.0 * opacity).ln() * [a, c][k]).sqrt();
        let from = (centre[k] - reach - 0.5).floor().clamp(0.0, image[k] as f64) as u32;
        let to = ((centre[k] + reach - 0.5).ceil() + 1.0).clamp(0.0, image[k] as f64) as u32;
        if to <= from {
            return None;
        }
        low[k] = from;
        size[k] = to - from;
    }
    Some(Footprint {
        centre,
        l11: (c / whole).sqrt(),
        l12: -s[1] / (c * whole).sqrt(),
        l22: 1.0 / c.sqrt(),
        opacity,
        low,
        size,
    })
}

impl Footprint {
    /// opacity · exp(−½ δᵀ(S + 0.3 I)⁻¹δ) at a pixel's centre, neither clamped nor cut off.
    pub fn response(&self, x: u32, y: u32) -> f64 {
        let (dx, dy) = (x as f64 + 0.5 - self.centre[0], y as f64 + 0.5 - self.centre[1]);
        let u = self.l11 * dx + self.l12 * dy;
        let v = self.l22 * dy;
        self.opacity * (-0.5 * (u * u + v * v)).exp()
    }

    /// α at a pixel; `None` if it is not covered.
    pub fn weight(&self, x: u32, y: u32) -> Option<f64> {
        let alpha = self.response(x, y);
        (alpha >= ALPHA_MIN).then(|| alpha.min(ALPHA_MAX))
    }

    /// Pixels of the bounding box, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let Footprint { low, size, .. } = *self;
        (low[1]..low[1] + size[1]).flat_map(move |y| (low[0]..low[0] + size[0]).map(move |x| (x, y)))
    }
}

/// True if a pixel has a surface, at a depth that float32 can hold.
pub fn is_depth(depth: f64) -> bool {
    depth > 0.0 && depth.is_finite()
}

/// Returns `point_counts`, one per 2D Gaussian.
pub fn lift_count(gaussians: &ScreenGaussians) -> Vec<u32> {
    (0..gaussians.len())
        .map(|item| match gaussians.footprint(item) {
            None => 0,
            Some(f) => {
                let covered = |&(x, y): &(u32, u32)| f.weight(x, y).is_some() && is_depth(gaussians.depth(item, x, y));
                f.pixels().filter(covered).count() as u32
            }
        })
        .collect()
}

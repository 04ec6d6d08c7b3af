//! A scene's parameters as planes, in float64.

use glam::DVec3;

use crate::scene::{Gaussians, Lobes, Scene, Supplement};
use crate::scene::{
    color,
    layout::{self, Array, GEOMETRY_PLANES, Group, LOBE_PLANES, LOG_SCALE, MEAN, OPACITY, QUAT},
};
use crate::{Error, Result};

/// Plane p of Gaussian i is `planes[p * stride + i]`; base Gaussians first, supplementary ones from `lobe_first` on.
/// Gradients and Adam's moments have the same layout and use the same type.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Params {
    /// Planes of [`layout`] × stride.
    pub geometry: Vec<f64>,
    /// Planes of [`layout`] × stride.
    pub sh: Vec<f64>,
    /// Planes of [`layout`] × lobe stride; those of Gaussian `lobe_first` + j at j.
    pub lobes: Vec<f64>,
    /// Gaussians, N + M.
    pub count: usize,
    /// Elements of a plane, ≥ `count`.
    pub stride: usize,
    /// N, the first Gaussian that has a lobe.
    pub lobe_first: usize,
    /// Elements of a lobe plane, ≥ M.
    pub lobe_stride: usize,
    /// L, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
}

impl Params {
    /// Strides are the counts. Fails if the scene's arrays do not have the documented lengths.
    pub fn from_scene(scene: &Scene) -> Result<Self> {
        let none = Supplement::default();
        let supplement = scene.supplement.as_ref().unwrap_or(&none);
        let (first, extra) = (scene.base.len(), supplement.gaussians.len());
        check("base", &scene.base)?;
        check("supplement", &supplement.gaussians)?;
        // Coefficients that a Gaussian lacks are 0.
        let of = |part: &Gaussians| if part.is_empty() { 0 } else { part.sh_degree };
        let sh_degree = if extra == 0 { scene.base.sh_degree } else { of(&scene.base).max(of(&supplement.gaussians)) };
        let parts = [&scene.base, &supplement.gaussians].into_iter().filter(|part| !part.is_empty());
        let colors = color::of(sh_degree);
        if let Some(other) = parts.map(|part| color::of(part.sh_degree)).find(|other| !other.shares_with(colors)) {
            let (one, other) = (colors.name, other.name);
            return Err(Error::Usage(format!("base and supplement: one has {one} and the other {other}")));
        }
        let lobes = &supplement.lobes;
        if lobes.directions.len() != extra || lobes.widths.len() != extra || lobes.sharpness.len() != extra {
            return Err(Error::Usage(format!("supplement: {extra} Gaussians need as many lobes")));
        }
        let mut params = Params::zeros(first + extra, first, sh_degree);
        for (gaussians, offset) in [(&scene.base, 0), (&supplement.gaussians, first)] {
            for j in 0..gaussians.len() {
                let i = offset + j;
                for (p, value) in layout::geometry(gaussians, j).into_iter().enumerate() {
                    params.geometry[p * params.stride + i] = f64::from(value);
                }
                // With the world's origin a number keeps its bits, even −0.
                for (axis, &from) in scene.origin.as_ref().iter().enumerate().filter(|(_, from)| **from != 0.0) {
                    params.geometry[(MEAN + axis) * params.stride + i] += from;
                }
                for p in 0..layout::sh_planes(sh_degree) {
                    params.sh[p * params.stride + i] = f64::from(layout::sh(gaussians, j, p));
                }
            }
        }
        for j in 0..extra {
            for (p, value) in layout::lobe(lobes, j).into_iter().enumerate() {
                params.lobes[p * params.lobe_stride + j] = f64::from(value);
            }
        }
        Ok(params)
    }

    /// The scene with every parameter rounded to float32. No supplement if no Gaussian has a lobe.
    pub fn to_scene(&self) -> Scene {
        let part = |from: usize, to: usize| {
            let mut part = Gaussians { sh_degree: self.sh_degree, ..Default::default() };
            for i in from..to {
                let plane = |planes: &[f64], p: usize| planes[p * self.stride + i] as f32;
                layout::push(&mut part, |p| plane(&self.geometry, p), |p| plane(&self.sh, p));
            }
            part
        };
        let supplement = (self.lobe_first < self.count).then(|| {
            let mut lobes = Lobes::default();
            for j in 0..self.count - self.lobe_first {
                layout::push_lobe(&mut lobes, |p| self.lobes[p * self.lobe_stride + j] as f32);
            }
            Supplement { gaussians: part(self.lobe_first, self.count), lobes }
        });
        Scene { base: part(0, self.lobe_first), supplement, ..Default::default() }
    }

    /// All zero, with strides equal to the counts.
    pub fn zeros(count: usize, lobe_first: usize, sh_degree: u32) -> Self {
        let lobe_stride = count - lobe_first.min(count);
        Params {
            geometry: vec![0.0; GEOMETRY_PLANES * count],
            sh: vec![0.0; layout::sh_planes(sh_degree) * count],
            lobes: vec![0.0; LOBE_PLANES * lobe_stride],
            count,
            stride: count,
            lobe_first,
            lobe_stride,
            sh_degree,
        }
    }

    /// All zero, in the same layout.
    pub fn zeros_like(&self) -> Self {
        Params {
            geometry: vec![0.0; self.geometry.len()],
            sh: vec![0.0; self.sh.len()],
            lobes: vec![0.0; self.lobes.len()],
            ..*self
        }
    }

    /// Coefficients per Gaussian and channel: (L + 1)², or those of betas.
    pub fn sh_coefficients(&self) -> usize {
        layout::coefficients(self.sh_degree)
    }

    /// The values of a group, plane by plane, of the Gaussians `first..first + count` (of the supplement for lobes).
    pub fn group(&self, group: &Group, first: usize, count: usize) -> impl Iterator<Item = f64> + '_ {
        let (values, stride, first) = match group.array {
            Array::Geometry => (&self.geometry, self.stride, first),
            Array::Sh => (&self.sh, self.stride, first),
            Array::Lobes => (&self.lobes, self.lobe_stride, first.saturating_sub(self.lobe_first)),
        };
        let at = move |p: usize| (first..first + count).map(move |i| values[p * stride + i]);
        group.planes.clone().flat_map(at)
    }

    /// Scene units.
    pub fn mean(&self, i: usize) -> DVec3 {
        self.triple(MEAN, i)
    }

    /// Natural logarithms of the standard deviations, scene units.
    pub fn log_scale(&self, i: usize) -> DVec3 {
        self.triple(LOG_SCALE, i)
    }

    /// (w, x, y, z), not normalised.
    pub fn quat(&self, i: usize) -> [f64; 4] {
        [QUAT, QUAT + 1, QUAT + 2, QUAT + 3].map(|p| self.geometry[p * self.stride + i])
    }

    /// ln(o / (1 − o)).
    pub fn logit(&self, i: usize) -> f64 {
        self.geometry[OPACITY * self.stride + i]
    }

    /// RGB coefficient k.
    pub fn coefficient(&self, i: usize, k: usize) -> [f64; 3] {
        [0, 1, 2].map(|c| self.sh[(3 * k + c) * self.stride + i])
    }

    /// Direction d, width T and sharpness β; none for a base Gaussian.
    pub fn lobe(&self, i: usize) -> Option<(DVec3, f64, f64)> {
        let j = i.checked_sub(self.lobe_first)?;
        let plane = |p: usize| self.lobes[p * self.lobe_stride + j];
        let direction = DVec3::new(plane(0), plane(1), plane(2));
        Some((direction, plane(layout::LOBE_WIDTH), plane(layout::LOBE_SHARPNESS)))
    }

    fn triple(&self, p: usize, i: usize) -> DVec3 {
        let plane = |p: usize| self.geometry[p * self.stride + i];
        DVec3::new(plane(p), plane(p + 1), plane(p + 2))
    }
}

fn check(name: &str, gaussians: &Gaussians) -> Result<()> {
    let n = gaussians.len();
    if n > 0 {
        color::check(gaussians.sh_degree).map_err(|what| Error::Usage(format!("{name}: {what}")))?;
    }
    let lengths = [gaussians.log_scales.len(), gaussians.quats.len(), gaussians.opacities.len()];
    if lengths.iter().any(|&length| length != n) || gaussians.sh.len() != n * gaussians.sh_coefficients() {
        return Err(Error::Usage(format!("{name}: arrays of {n} Gaussians differ in length")));
    }
    Ok(())
}

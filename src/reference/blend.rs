//! Twin of `blend.comp`: composites each pixel's Gaussians front to back (3DGS).
//!
//! splats, intersections, background → image (RGB and transmittance), median Gaussian. One iteration is one thread.

use rayon::prelude::*;

use super::{ALPHA_MAX, ALPHA_MIN, Background, Intersections, NONE, Splat, TRANSMITTANCE_MIN};

/// All vectors by pixel, row-major.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Blended {
    /// RGB with the background composited, and the remaining transmittance.
    pub image: Vec<[f64; 4]>,
    /// The Gaussian that first took the transmittance below the median threshold, or `NONE`.
    pub median: Vec<u32>,
    /// How far the pixel's decisions were from changing. Not on the GPU.
    pub margins: Vec<Margin>,
    /// A hash of every decision the pixel made, in order. Not on the GPU. If it differs between two renders,
    /// a threshold or the order of two Gaussians was crossed.
    pub decisions: Vec<u64>,
}

/// Smallest distance to each threshold that a pixel met, relative to the threshold; ∞ if it met none. Float32
/// may decide differently from float64 only if a distance is of the order of float32's error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Margin {
    /// |α − 1/255| · 255.
    pub alpha: f64,
    /// |T' − 1e-4| / 1e-4.
    pub transmittance: f64,
    /// |o·exp(power) − 0.99| / 0.99. The image is continuous across it, the gradient is not.
    pub clamp: f64,
    /// Gap in camera z between a contributor and the occluder, relative to the latter.
    pub occluder: f64,
    /// |T' − median threshold| / median threshold.
    pub median: f64,
    /// Gap in camera z between two consecutive contributors, relative to it. 0 if they are equal, and then
    /// the index decides.
    pub order: f64,
}

impl Margin {
    const NONE: Margin = Margin {
        alpha: f64::INFINITY,
        transmittance: f64::INFINITY,
        clamp: f64::INFINITY,
        occluder: f64::INFINITY,
        median: f64::INFINITY,
        order: f64::INFINITY,
    };

    /// Smallest margin of the decisions that make the image jump.
    pub fn image(&self) -> f64 {
        self.alpha.min(self.transmittance).min(self.order).min(self.occluder)
    }

    /// Smallest margin of those and of the kink at 0.99.
    pub fn gradient(&self) -> f64 {
        self.image().min(self.clamp)
    }
}

/// One Gaussian's share of one pixel, as computed in both passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    pub wu: f64,
    pub wv: f64,
    /// exp(−½|w|²).
    pub falloff: f64,
    pub alpha: f64,
    /// α was clamped to 0.99.
    pub clamped: bool,
}

pub(super) fn sample(splat: &Splat, column: u32, row: u32) -> Sample {
    let (wu, wv) = splat.whiten(column, row);
    let falloff = (-0.5 * (wu * wu + wv * wv)).exp();
    let raw = splat.opacity * falloff;
    Sample { wu, wv, falloff, alpha: raw.min(ALPHA_MAX), clamped: raw > ALPHA_MAX }
}

/// Blends the splats; `median_threshold` is the transmittance at which a pixel has its median.
pub fn blend(splats: &[Splat], isects: &Intersections, background: Background, median_threshold: f64) -> Blended {
    blend_before(splats, isects, background, median_threshold, |_| f64::INFINITY)
}

/// Blends for each pixel only splats that are not beyond camera z `farthest`.
pub fn blend_before(
    splats: &[Splat],
    isects: &Intersections,
    background: Background,
    median_threshold: f64,
    farthest: impl Fn(usize) -> f64 + Sync,
) -> Blended {
    let tiling = isects.tiling;
    let pixels: Vec<Pixel> = (0..tiling.width as usize * tiling.height as usize)
        .into_par_iter()
        .map(|pixel| {
            let (column, row) = ((pixel % tiling.width as usize) as u32, (pixel / tiling.width as usize) as u32);
            blend_pixel(splats, isects, [column, row], background.at(pixel), median_threshold, farthest(pixel))
        })
        .collect();
    Blended {
        image: pixels.iter().map(|p| p.color).collect(),
        median: pixels.iter().map(|p| p.median).collect(),
        margins: pixels.iter().map(|p| p.margin).collect(),
        decisions: pixels.iter().map(|p| p.decisions).collect(),
    }
}

struct Pixel {
    color: [f64; 4],
    median: u32,
    margin: Margin,
    decisions: u64,
}

fn blend_pixel(
    splats: &[Splat],
    isects: &Intersections,
    [column, row]: [u32; 2],
    background: [f64; 3],
    median_threshold: f64,
    farthest: f64,
) -> Pixel {
    let mut color = [0.0; 3];
    let mut transmittance = 1.0;
    let mut median = NONE;
    let mut margin = Margin::NONE;
    let mut decisions = Decisions::new();
    let mut last_z = f64::NEG_INFINITY;
    for global in isects.of_pixel(column, row).map(|(_, global)| global) {
        let splat = &splats[global as usize];
        if farthest.is_finite() {
            margin.occluder = margin.occluder.min((splat.z / farthest - 1.0).abs());
        }
        if splat.z > farthest {
            break;
        }
        let s = sample(splat, column, row);
        margin.alpha = margin.alpha.min((s.alpha - ALPHA_MIN).abs() / ALPHA_MIN);
        if !(s.alpha >= ALPHA_MIN) {
            continue;
        }
        margin.clamp = margin.clamp.min((splat.opacity * s.falloff - ALPHA_MAX).abs() / ALPHA_MAX);
        margin.order = margin.order.min((splat.z - last_z) / splat.z);
        last_z = splat.z;
        let next = transmittance * (1.0 - s.alpha);
        margin.transmittance = margin.transmittance.min((next - TRANSMITTANCE_MIN).abs() / TRANSMITTANCE_MIN);
        if next < TRANSMITTANCE_MIN {
            decisions.add(global, 2);
            break;
        }
        decisions.add(global, s.clamped as u64);
        for (sum, c) in color.iter_mut().zip(splat.color()) {
            *sum += c * s.alpha * transmittance;
        }
        transmittance = next;
        margin.median = margin.median.min((next - median_threshold).abs() / median_threshold);
        if median == NONE && transmittance < median_threshold {
            median = global;
        }
    }
    for (sum, b) in color.iter_mut().zip(background) {
        *sum += transmittance * b;
    }
    let [r, g, b] = color;
    Pixel { color: [r, g, b, transmittance], median, margin, decisions: decisions.0 }
}

/// FNV-1a over (Gaussian, outcome): collisions are as rare as 64 bits make them.
struct Decisions(u64);

impl Decisions {
    fn new() -> Self {
        Decisions(0xcbf29ce484222325)
    }

    fn add(&mut self, global: u32, event: u64) {
        self.0 = (self.0 ^ ((global as u64) << 2 | event)).wrapping_mul(0x100000001b3);
        self.0 ^= self.0 >> 29;
    }
}

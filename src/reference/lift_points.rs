//! Twin of `lift_points.comp`: converts the covered pixels of each 2D Gaussian to weighted 3D points (method,
//! section 4.1).

use super::lift_count::{ScreenGaussians, is_depth};

/// The first threshold of clustering in pixels' widths (appendix A: 5·δd).
pub const TAU_PIXELS: f64 = 5.0;

/// Points of all 2D Gaussians; those of item i are `points[firsts[i]..][..counts[i]]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LiftPoints {
    /// Number of points of each item.
    pub counts: Vec<u32>,
    /// First point of each item.
    pub firsts: Vec<u32>,
    /// (x, y, z, weight) in the frame of the view's camera, pixels in row-major order.
    pub points: Vec<[f64; 4]>,
    /// Index within the set of the point of greatest weight; ties go to the lowest index; 0 for an empty set.
    pub heaviest: Vec<u32>,
    /// τ0 = 5·depth/fx, with the depth at the centre or, if it has none, at the heaviest point; 0 for an
    /// empty set.
    pub start_taus: Vec<f64>,
}

impl LiftPoints {
    /// The points of one item.
    pub fn set(&self, item: usize) -> &[[f64; 4]] {
        let first = self.firsts[item] as usize;
        &self.points[first..first + self.counts[item] as usize]
    }
}

/// Points, heaviest ones and first thresholds of all items, in their order.
pub fn lift_points(gaussians: &ScreenGaussians) -> LiftPoints {
    let mut out = LiftPoints::default();
    for item in 0..gaussians.len() {
        let first = out.points.len();
        let mut best = 0;
        if let (Some(camera), Some(f)) = (gaussians.view(item), gaussians.footprint(item)) {
            for (x, y) in f.pixels() {
                let depth = gaussians.depth(item, x, y);
                let Some(weight) = f.weight(x, y) else { continue };
                if !is_depth(depth) {
                    continue;
                }
                let ray = [(x as f64 + 0.5 - camera.cx) / camera.fx, (y as f64 + 0.5 - camera.cy) / camera.fy];
                out.points.push([ray[0] * depth, ray[1] * depth, depth, weight]);
                if weight > out.points[first + best][3] {
                    best = out.points.len() - 1 - first;
                }
            }
        }
        let centre = gaussians.get(9, item);
        let tau = match (out.points.get(first + best), gaussians.view(item)) {
            (Some(heavy), Some(camera)) => TAU_PIXELS * if is_depth(centre) { centre } else { heavy[2] } / camera.fx,
            _ => 0.0,
        };
        out.counts.push((out.points.len() - first) as u32);
        out.firsts.push(first as u32);
        out.heaviest.push(best as u32);
        out.start_taus.push(tau);
    }
    out
}

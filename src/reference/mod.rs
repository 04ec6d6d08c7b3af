//! The float64 twin of every stage: same name, same loops, on the host. Tests compare each kernel's results
//! with these functions, and these functions with central differences (`tests/invariants/gradients.rs`). [`host`] lets
//! them replace stages.
//!
//! Layouts are those of `docs/design-notes.md`: parameters are planes, base Gaussians come first.
//! Slices must have the lengths documented; the twins do not check what the stages check.

// The house style guards positively, so that NaN fails: `!(x >= lo)` is intended, here as in the kernels.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod adam;
pub mod bands_fit;
pub mod bands_look;
pub mod betas;
pub mod blend;
pub mod blend_backward;
pub mod blend_backward_atomic;
pub mod composite;
pub mod density_apply;
pub mod density_draw;
pub mod density_image;
pub mod density_noise;
pub mod density_place;
pub mod density_plan;
pub mod density_score;
pub mod density_weigh;
pub mod dispatch_args;
pub mod emit;
pub mod exposure_apply;
pub mod exposure_backward;
pub mod exposure_step;
pub mod fma_rate;
pub mod gather;
pub mod harmonics;
pub mod hash;
pub mod host;
pub mod lift_append;
pub mod lift_cluster;
pub mod lift_count;
pub mod lift_groups;
pub mod lift_join;
pub mod lift_pca;
pub mod lift_points;
pub mod lobe;
pub mod loss_probe;
pub mod loss_sum;
pub mod median_depth;
pub mod packed_record;
pub mod packed_splat;
pub mod project;
pub mod project_backward;
pub mod pursuit;
pub mod pursuit_attenuate;
pub mod pursuit_blur;
pub mod pursuit_claim;
pub mod pursuit_draw;
pub mod pursuit_fit;
pub mod pursuit_gain;
pub mod pursuit_place;
pub mod pursuit_quanta;
pub mod pursuit_residual;
pub mod pursuit_score;
pub mod pursuit_sight;
pub mod radix_downsweep;
pub mod radix_spine;
pub mod radix_upsweep;
pub mod recount;
pub mod render;
pub mod resolve;
pub mod sample;
pub mod scan_apply;
pub mod scan_reduce;
pub mod scan_spine;
pub mod screen_backward;
pub mod screen_draw;
pub mod screen_project;
pub mod screen_prune;
pub mod screen_tiles;
pub mod sort;
pub mod ssim_backward;
pub mod ssim_forward;
pub mod step_done;
pub mod tile_ranges;
pub mod tiles;

mod params;
mod view;

pub use host::{twin, twins};
pub use params::Params;
pub use render::{Intersections, Options, Rendered, render};
pub use sample::{covering_scene, random_camera, random_scene};
pub use view::View;

/// Smallest α that contributes to a pixel (3DGS): half a step of an 8-bit image, rounded up.
pub const ALPHA_MIN: f64 = 1.0 / 255.0;
/// Largest α (3DGS): keeps 1 − α, a divisor in the backward pass, away from 0.
pub const ALPHA_MAX: f64 = 0.99;
/// A pixel stops before the Gaussian that would take its transmittance below this (3DGS).
pub const TRANSMITTANCE_MIN: f64 = 1e-4;
/// Near plane, scene units (3DGS).
pub const NEAR: f64 = crate::data::NEAR;
/// Variance added to the projected Gaussian, px² (3DGS): no splat is thinner than a pixel.
pub const DILATION: f64 = 0.3;
/// Smallest normal float32. The twin ignores numbers that a kernel cannot hold.
pub const FLOAT_MIN: f64 = f32::MIN_POSITIVE as f64;
/// Largest finite float32.
pub const FLOAT_MAX: f64 = f32::MAX as f64;
/// "No Gaussian" in place of a Gaussian index.
pub const NONE: u32 = u32::MAX;

/// A Gaussian projected into a view; `docs/design-notes.md` defines the factor L.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Splat {
    /// Centre, px.
    pub x: f64,
    /// Centre, px.
    pub y: f64,
    /// L = [[l11, l12], [0, l22]] with LᵀL = Σ2D⁻¹, 1/px.
    pub l11: f64,
    /// Entry of L, 1/px.
    pub l12: f64,
    /// Entry of L, 1/px.
    pub l22: f64,
    /// σ(logit) · lobe · compensation.
    pub opacity: f64,
    /// Color, ≥ 0.
    pub r: f64,
    /// Color, ≥ 0.
    pub g: f64,
    /// Color, ≥ 0.
    pub b: f64,
    /// Camera z, scene units.
    pub z: f64,
}

impl Splat {
    /// sRGB, not clamped to 1.
    pub fn color(&self) -> [f64; 3] {
        [self.r, self.g, self.b]
    }

    /// w = Lδ at a pixel's centre; the exponent is −½|w|².
    pub fn whiten(&self, column: u32, row: u32) -> (f64, f64) {
        let dx = column as f64 + 0.5 - self.x;
        let dy = row as f64 + 0.5 - self.y;
        (self.l11 * dx + self.l12 * dy, self.l22 * dy)
    }
}

/// The constant color or the image (row-major, width · height pixels) behind all Gaussians.
#[derive(Debug, Clone, Copy)]
pub enum Background<'a> {
    /// One color for all pixels, sRGB.
    Color([f64; 3]),
    /// By pixel: the backdrop of a screen phase.
    Image(&'a [[f64; 3]]),
}

impl Background<'_> {
    /// The background at pixel number `pixel`, rows from the top.
    pub fn at(&self, pixel: usize) -> [f64; 3] {
        match self {
            Background::Color(color) => *color,
            Background::Image(image) => image[pixel],
        }
    }
}

pub(crate) fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::constants as kernels;

    /// The twins define their own numbers in float64, so that a wrong number in a kernel shows. This compares
    /// those with a name on both sides.
    #[test]
    fn twins_have_the_kernels_constants() {
        for (name, twin, kernel) in [
            ("NEAR", NEAR, kernels::constants::NEAR),
            ("DILATION", DILATION, kernels::constants::DILATION),
            ("SH_C0", harmonics::C0, kernels::constants::SH_C0),
            ("ALPHA_MAX", ALPHA_MAX, kernels::splat::ALPHA_MAX),
            ("T_MIN", TRANSMITTANCE_MIN, kernels::splat::T_MIN),
            ("FLOAT_MIN", FLOAT_MIN, kernels::unit::FLOAT_MIN),
            ("FLOAT_MAX", FLOAT_MAX, kernels::unit::FLOAT_MAX),
            ("GRADIENT_MAX", adam::GRADIENT_MAX, kernels::adam_one::GRADIENT_MAX),
            ("CURVATURE_DECAY", adam::CURVATURE_DECAY, kernels::adam_one::CURVATURE_DECAY),
            ("NEWTON_REACH", adam::NEWTON_REACH, kernels::adam_one::NEWTON_REACH),
            ("FIRST_SCALE_MIN", screen_backward::FIRST_SCALE_MIN, kernels::screen::FIRST_SCALE_MIN),
            ("FIRST_BLUR", pursuit::FIRST_BLUR, kernels::pursuit::FIRST_BLUR),
            ("NEXT_BLUR", pursuit::NEXT_BLUR, kernels::pursuit::NEXT_BLUR),
            ("REACH", pursuit::REACH, kernels::pursuit::REACH),
            ("CORE", pursuit::CORE, kernels::pursuit::CORE),
            ("WINDOW_SLACK", pursuit::WINDOW_SLACK, kernels::pursuit::WINDOW_SLACK),
            ("WHOLE", pursuit::WHOLE, kernels::pursuit::WHOLE),
            ("WIDEST", pursuit::WIDEST, kernels::pursuit::WIDEST),
            ("SAME_DEPTH", pursuit::SAME_DEPTH, kernels::pursuit::SAME_DEPTH),
        ] {
            assert_eq!(twin as f32, kernel, "{name}");
        }
        assert_eq!((NONE, lift_groups::GROUP_MIN), (kernels::constants::NONE, kernels::cluster::GROUP_MIN));
    }
}

//! Every bound once, with its reason.

use serde::Serialize;

/// What a stage's errors may be, see [`super::judge::Errors`]. 1 − cosine may be the square of the relative L2 error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bound {
    pub stage: &'static str,
    pub max: f64,
    pub relative_l2: f64,
    pub bias: f64,
    pub flips: f64,
    pub reason: &'static str,
}

impl Bound {
    pub(super) const fn exact(stage: &'static str, reason: &'static str) -> Self {
        Bound { stage, max: 0.0, relative_l2: 0.0, bias: 0.0, flips: 0.0, reason }
    }
}

/// Float32 may decide otherwise than float64 where a pixel is this close (relatively) to a threshold. The exponent has an
/// error of some 1e-6 (|w|² ≤ 11 from coordinates of 1e2 px with 1e-7 of rounding, times slopes up to 1/0.55 per px: 2e-5
/// px·/px), α as much again, and a transmittance is a product of up to a few hundred factors: 1e-4 holds all of them.
pub const NEAR_THRESHOLD: f64 = 1e-4;

/// Bound of a stage.
pub fn of(stage: &str) -> Option<Bound> {
    BOUNDS.into_iter().find(|b| b.stage == stage)
}

const INTEGERS: &str = "Integers: equal means equal.";

pub const BOUNDS: [Bound; 31] = [
    Bound {
        stage: "fma_rate",
        max: 5e-7,
        relative_l2: 5e-7,
        bias: 0.0,
        flips: 0.0,
        reason: "x ← x/2 + 1 halves every earlier rounding, so two roundings of 6e-8 remain in each of eight chains, and seven \
                 more in their sum.",
    },
    Bound::exact("dispatch_args", INTEGERS),
    Bound::exact("scan_reduce", INTEGERS),
    Bound::exact("scan_spine", INTEGERS),
    Bound::exact("scan_apply", INTEGERS),
    Bound::exact("radix_upsweep", INTEGERS),
    Bound::exact("radix_spine", INTEGERS),
    Bound::exact("radix_downsweep", INTEGERS),
    Bound::exact("tile_ranges", INTEGERS),
    Bound { stage: "project", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "emit", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "blend", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "median_depth", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "blend_backward", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "project_backward", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "(render)", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "ssim_forward", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "ssim_backward", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "loss_sum", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "plane_project", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "plane_backward", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "plane_prune", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "plane_draw", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "lift_count", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "lift_points", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "lift_join", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "lift_groups", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "lift_pca", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound { stage: "(render backward)", max: 1e-4, relative_l2: 1e-4, bias: 1e-4, flips: 0.05, reason: "" },
    Bound::exact("step_done", INTEGERS),
    Bound::exact("lift_append", "Copies words; none is computed."),
];

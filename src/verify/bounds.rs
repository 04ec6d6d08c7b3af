//! Error bounds of every stage, each with its reason.

use serde::Serialize;

/// Maximum errors of a stage, see [`super::judge::Errors`]. 1 − cosine may reach the square of the relative
/// L2 error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bound {
    /// Name of the kernel, or in brackets of a group of kernels judged together.
    pub stage: &'static str,
    /// Bound of [`Errors::max`](super::judge::Errors::max); the other fields are likewise named.
    pub max: f64,
    /// See `max`.
    pub relative_l2: f64,
    /// See `max`; 0 if there are no gradients.
    pub bias: f64,
    /// See `max`; 0 if the stage makes no decisions.
    pub flips: f64,
    /// Reason why the bound can be neither tighter nor looser.
    pub reason: &'static str,
}

impl Bound {
    pub(super) const fn exact(stage: &'static str, reason: &'static str) -> Self {
        Bound { stage, reason, ..EXACT }
    }
}

const EXACT: Bound = Bound { stage: "", max: 0.0, relative_l2: 0.0, bias: 0.0, flips: 0.0, reason: "" };

/// Relative distance from a threshold within which float32 may decide otherwise than float64. The exponent
/// has an error of about 1e-6 (|w|² ≤ 11 from coordinates of 1e2 px with 1e-7 of rounding, times slopes up to
/// 1/0.55 per px: 2e-5 px·px/px). α adds as much again, and a transmittance is a product of up to a few
/// hundred factors: 1e-4 covers all of these.
pub const NEAR_THRESHOLD: f64 = 1e-4;

/// The bound of a stage; `None` if it has none.
pub fn of(stage: &str) -> Option<Bound> {
    BOUNDS.into_iter().find(|b| b.stage == stage)
}

const INTEGERS: &str = "Integers: equal means equal.";
const CLUSTERS: &str = "τ grows by 1.5 with a rounding of 6e-8 each, 32 times at most. A set may fall apart otherwise only where two \
                        points are within 1e-5 of a τ apart, which chance does to less than one set in a hundred.";
const LOSS: &str = "One SSIM errs by up to 6e-8 / C2 = 7e-5 where the variance is 0 and by a fifth of that as a loss. \
                    Losses are of order 0.05 to 1, and in a frame of one pixel nothing averages it out: 3e-4.";

// The bounds allow exponentials, logarithms, roots and quotients as inexact as Vulkan permits: `tools/devices
// rough` tests this. Vulkan promises little for sines, cosines and angles, so kernels compute those with
// polynomials.
/// All bounds, in the order of the table.
pub const BOUNDS: [Bound; 61] = [
    Bound {
        stage: "fma_rate",
        max: 5e-7,
        relative_l2: 5e-7,
        reason: "x ← x/2 + 1 halves every earlier rounding, so two roundings of 6e-8 remain in each of eight chains, and \
                 seven more in their sum.",
        ..EXACT
    },
    Bound::exact("dispatch_args", INTEGERS),
    Bound::exact("scan_reduce", INTEGERS),
    Bound::exact("scan_spine", INTEGERS),
    Bound::exact("scan_apply", INTEGERS),
    Bound::exact("radix_upsweep", INTEGERS),
    Bound::exact("radix_spine", INTEGERS),
    Bound::exact("radix_downsweep", INTEGERS),
    Bound::exact("recount", INTEGERS),
    Bound::exact("gather", "Copies words; none is computed."),
    Bound {
        stage: "project",
        max: 1e-4,
        relative_l2: 1e-5,
        flips: 0.02,
        reason: "A dozen roundings of 6e-8, 1e-6 together; the camera's depth, down to 0.4 of coordinates up to 12, is a \
                 difference and makes 30 times that of it in what is nearest and largest. Flips are counts of tiles: an edge \
                 within the margin around an ellipse (1/256 px) of a tile's border, two of whose eight pixels' ends count, \
                 for one Gaussian in a hundred.",
        ..EXACT
    },
    Bound {
        stage: "emit",
        flips: 0.01,
        reason: "Both sides may list a tile too many where an ellipse's margin meets a tile's border; a tile with a pixel \
                 that is covered by 1e-4 more than the threshold must be listed, and the order is exact.",
        ..EXACT
    },
    Bound::exact("tile_ranges", INTEGERS),
    Bound {
        stage: "blend",
        max: 1e-4,
        relative_l2: 1e-5,
        flips: 1e-3,
        reason: "α errs by |w| ≤ 3.3 times the error of w, which for the longest needles is 1e-7 of 200: 7e-5; for all others \
                 1e-6, like exp. A pixel is the mean of many. Flips need an α within 1e-4 of 1/255 or a transmittance \
                 within 1e-4 of 1e-4, and only the few that jump are counted.",
        ..EXACT
    },
    Bound {
        stage: "median_depth",
        max: 1e-4,
        relative_l2: 1e-5,
        flips: 1e-3,
        reason: "o·d / d·d cancels where the Gaussian lies beside the ray: a hundred times 1e-7, tenfold at worst. Flips are \
                 depths within 1e-4 of the near plane.",
        ..EXACT
    },
    Bound {
        stage: "blend_backward",
        max: 3e-4,
        relative_l2: 1e-4,
        bias: 1e-5,
        flips: 0.05,
        reason: "Vulkan promises exp(x) to 3 + 2|x| roundings of 6e-8, so α to 8e-7 of itself for the smallest, 1/255, and 1 − α to 1e-6 / \
                 (1 − α), 1e-4 for the largest, 0.99. What lies behind is the final color less all before it, divided by that; \
                 α itself and the transmittance, a product of such factors, add as much each: 3e-4, and in the mean a third. \
                 In records, sums over a tile, it grows no further. \
                 A packed number is a code of some 2^-9: an error of 1e-5 of terms that cancel puts one in fifty on the other side.",
    },
    Bound {
        stage: "blend_backward_atomic",
        max: 3e-4,
        relative_l2: 1e-4,
        bias: 1e-5,
        reason: "The same as blend_backward's: a Gaussian has up to some hundred tiles here, and sums of n terms one after the other \
                 add at most n roundings of 6e-8 where all terms are alike, 3e-6.",
        ..EXACT
    },
    Bound {
        stage: "project_backward",
        max: 3e-4,
        relative_l2: 1e-4,
        bias: 3e-5,
        flips: 0.01,
        reason: "Records that partly cancel, through a chain whose depth is a difference as in project: 1e-5 usual, 1e-4 what is \
                 promised. In steps, 1 − 0.999 in float32 is off by 1.3e-5, so the second moment's share of g² is. A word of moments holds \
                 the second in steps of 2^-8 of itself, so an error of 1.3e-5 puts one in 300 on the other side of the draw by which it \
                 is rounded; of the first, in steps of 2^-7, fewer. Without the draw it is one in 30. Of betas a few in 1e5 have a factor near 0, \
                 the angle left to a lobe's end, which float32 knows to 1e-3. Where nothing is packed, one in 10,000 at most.",
    },
    Bound {
        stage: "adam",
        max: 5e-5,
        relative_l2: 2e-5,
        flips: 0.01,
        reason: "1 − 0.999 in float32 is off by 1.3e-5, so the second moment's share of g² is; the step, of which it is the root, \
                 and the parameter, which it changes by a hundredth, are off by less. Words of moments as project_backward.",
        ..EXACT
    },
    Bound {
        stage: "resolve",
        max: 2e-5,
        relative_l2: 5e-6,
        flips: 0.01,
        reason: "sRGB's powers are exp2 of 2.4 log2: Vulkan allows log2 an error of 3 units in the last place of a number of up to 10, \
                 1e-6, and the power 2.4 times that; two of them where something is exposed or blended. A texel may have the code beside \
                 it where a number is within 2e-5 of the border between two of 255.",
        ..EXACT
    },
    Bound::exact("step_done", INTEGERS),
    Bound {
        stage: "ssim_forward",
        max: 2e-3,
        relative_l2: 1e-3,
        reason: "In flat areas a variance of 0 is the difference of numbers of order 1: a dozen roundings of 6e-8 over C2 = 9e-4 are 8e-4 of a \
                 partial, everywhere in a flat picture. The losses have a tenth of that.",
        ..EXACT
    },
    Bound {
        stage: "ssim_backward",
        max: 3e-4,
        relative_l2: 1e-4,
        bias: 5e-5,
        reason: "In units of 1 / (3 pixels) the L1 part is 0.8. Of the SSIM part the partials err by 7e-5 of themselves, and \
                 what they sum up to in flat areas has the rounding of numbers up to 1 / C2 = 1100: 6e-8 of that, times 0.2, \
                 a few times over. In flat areas of one color the rounding is the same everywhere, hence the bias.",
        ..EXACT
    },
    Bound { stage: "loss_sum", max: 3e-4, relative_l2: 3e-4, reason: LOSS, ..EXACT },
    Bound::exact("composite", INTEGERS),
    Bound {
        stage: "loss_probe",
        max: 1e-5,
        relative_l2: 4e-6,
        reason: "A difference of two numbers of order 1 is rounded by 6e-8, and by 2 ULP in the quotient of one, and is 0.01 at least where \
                 it counts: 2e-5 of it, half of that of the root, a fifth of that on average. Signs are drawn by integers.",
        ..EXACT
    },
    Bound {
        stage: "exposure_apply",
        max: 1e-6,
        relative_l2: 5e-7,
        reason: "Three products and three sums of numbers of order 1: six roundings of 6e-8.",
        ..EXACT
    },
    Bound {
        stage: "exposure_backward",
        max: 5e-6,
        relative_l2: 2e-6,
        bias: 1e-6,
        reason: "By pixels as exposure_apply. A sum of 1024 terms is made in 8 lanes at least, 128 terms in each, whose roundings of 6e-8 \
                 add up as a walk: some 1e-6 of the sum of the terms' magnitudes, which is the sum's own a few times over.",
        ..EXACT
    },
    Bound {
        stage: "exposure_step",
        max: 5e-5,
        relative_l2: 2e-5,
        reason: "1 − 0.999 in float32 is off by 1.3e-5, so the second moment's share of g² is, and so is its correction, of which it is \
                 divided. Gradients are sums of some thousand terms that partly cancel, known to 1e-6; a mean over maps to 1e-7.",
        ..EXACT
    },
    Bound {
        stage: "screen_project",
        max: 1e-5,
        relative_l2: 5e-6,
        flips: 0.02,
        reason: "A dozen roundings of 6e-8, and sine and cosine within 1e-6. Flips as in project.",
        ..EXACT
    },
    Bound {
        stage: "screen_tiles",
        flips: 0.01,
        reason: "A tile too many where a box grown by a hundredth of a pixel, float32's error and more, reaches one: a box's edge \
                 is that near to a tile's for one in a thousand. None may be missing.",
        ..EXACT
    },
    Bound {
        stage: "screen_backward",
        max: 1e-4,
        relative_l2: 5e-5,
        bias: 1e-5,
        reason: "Gradients as screen_project, from sums that partly cancel: tenfold. In steps, 1 − 0.999 as in project_backward.",
        ..EXACT
    },
    Bound {
        stage: "screen_prune",
        flips: 5e-3,
        reason: "Only Gaussians whose count of pixels is at the least while one of these is within 1e-4 of 1/255.",
        ..EXACT
    },
    Bound {
        stage: "screen_draw",
        max: 1e-6,
        relative_l2: 1e-6,
        flips: 0.2,
        reason: "Copies and an exponential. Two keys within 1e-5 at the last place may change sides: 2 of 14 in the smallest draw.",
        ..EXACT
    },
    Bound {
        stage: "lift_count",
        flips: 1e-3,
        reason: "Pixels with α within 1e-5 of 1/255, of which there are fewer than one in a thousand.",
        ..EXACT
    },
    Bound {
        stage: "lift_points",
        max: 5e-6,
        relative_l2: 2e-6,
        flips: 0.01,
        reason: "Two products of rounded factors, and an exponential within 1e-6. Flips are equal greatest weights.",
        ..EXACT
    },
    Bound { stage: "lift_join", max: 2e-6, relative_l2: 2e-6, flips: 0.01, reason: CLUSTERS, ..EXACT },
    Bound { stage: "lift_groups", max: 2e-6, relative_l2: 2e-6, flips: 0.01, reason: CLUSTERS, ..EXACT },
    Bound {
        stage: "lift_pca",
        max: 5e-5,
        relative_l2: 5e-5,
        reason: "Jacobi in float32 errs by some 1e-6 of the greatest eigenvalue, the sums over up to a thousand points by as \
                 much, k² by a few 1e-6 of itself: 2e-5 of the largest entry. Angles add the position's 1e-6.",
        ..EXACT
    },
    Bound::exact("lift_append", "Copies words; none is computed."),
    Bound {
        stage: "density_image",
        max: 1e-6,
        relative_l2: 1e-6,
        reason: "A quotient by 255, three differences of up to 1 and their mean: six roundings of 6e-8.",
        ..EXACT
    },
    Bound {
        stage: "density_score",
        max: 2e-6,
        relative_l2: 1e-6,
        reason: "Sums of up to nine terms, or of some per lane and as many more as there are lanes, a length of two products, and the sum so \
                 far: two dozen roundings of 6e-8.",
        ..EXACT
    },
    Bound {
        stage: "density_weigh",
        max: 1e-5,
        relative_l2: 1e-5,
        reason: "A power, a logarithm and an exponential of 1e-6 each; a weight of up to 358,000 may be one more or less.",
        ..EXACT
    },
    Bound::exact("density_plan", INTEGERS),
    Bound::exact("density_draw", INTEGERS),
    Bound::exact("density_place", INTEGERS),
    Bound {
        stage: "density_apply",
        max: 1e-4,
        relative_l2: 1e-5,
        reason: "An opacity from 0.005 on is 1 less a power that has an error of 2e-7: 4e-5 of itself, and as much of its logit. \
                 Sums of binomials alternate, for eight copies below 2^8 roundings of 6e-8.",
        ..EXACT
    },
    Bound {
        stage: "density_noise",
        max: 1e-5,
        relative_l2: 1e-5,
        reason: "The gate is an exponential of 100 times an opacity that has an error of 6e-8, e and Sigma products of logarithms, \
                 exponentials and cosines of 1e-6.",
        ..EXACT
    },
    Bound {
        stage: "pursuit_residual",
        max: 1e-3,
        relative_l2: 1e-4,
        reason: "Texels are rounded to halves: what float32 and float64 round otherwise is one unit of a half, 2^-11 of itself, and that is \
                 rare. Errors and their sums of 256 have a dozen roundings of 6e-8.",
        ..EXACT
    },
    Bound {
        stage: "pursuit_blur",
        max: 1e-3,
        relative_l2: 1e-4,
        reason: "As pursuit_residual: rounded to halves, seldom otherwise; sums of 64 products err by 1e-6.",
        ..EXACT
    },
    Bound {
        stage: "pursuit_quanta",
        max: 1e-5,
        relative_l2: 1e-5,
        reason: "A sum of up to a million terms, some thousand in a row for each thread, and a quotient: 1e-6; whole numbers from there.",
        ..EXACT
    },
    Bound {
        stage: "pursuit_draw",
        max: 1e-5,
        relative_l2: 1e-5,
        flips: 0.02,
        reason: "A point is a sum of products of coordinates up to 10 with a few roundings, an angle one of atan. Which pixel it is flips where \
                 a draw falls within 2e-5 of a block's errors of a border between two of its 256 pixels.",
        ..EXACT
    },
    Bound {
        stage: "pursuit_score",
        max: 1e-4,
        relative_l2: 2e-5,
        reason: "Places in an image are known to 1e-5 px, between texels whose difference is 1 at most; sums over views have 1e-6 besides. \
                 Candidates that float32 may see otherwise (within 2e-4 px of a border of a pixel in one of five views, or of the edge \
                 of the same depth) are left out from here on, one in twenty at most.",
        ..EXACT
    },
    Bound {
        stage: "pursuit_fit",
        max: 1e-2,
        relative_l2: 1e-3,
        flips: 0.01,
        reason: "Opacity and color are quotients of differences of sums that cancel by up to a factor of a thousand; the gain is flat around \
                 them. Of 24,000 candidates the worst is 6.8e-3. Another size or width may be taken where it gains the same to 1e-3, or to \
                 the rounding of its sums.",
        ..EXACT
    },
    Bound::exact("pursuit_sight", "Bits; what float32 may see otherwise is left out."),
    Bound {
        stage: "pursuit_gain",
        max: 1e-4,
        relative_l2: 2e-5,
        reason: "As pursuit_score: a place to 1e-5 px, differences of squares of up to 1.",
        ..EXACT
    },
    Bound::exact(
        "pursuit_claim",
        "Windows end at whole pixels and gains are compared by their bits; what may fall otherwise is left out.",
    ),
    Bound {
        stage: "pursuit_attenuate",
        max: 1e-4,
        relative_l2: 1e-5,
        flips: 1e-3,
        reason: "What remains of a residual, to 1e-5 for each that takes of it, from a logarithm in units of 2^-16. The logarithm itself is \
                 known a thousand times less well where nearly nothing remains. A window is rounded up from 1e-3 px above a whole number \
                 on, where chance puts one in ten thousand within float32's error: the pixels of one border of a few dozen pixels, where what remains \
                 differs by 0.044 at most.",
        ..EXACT
    },
    Bound {
        stage: "pursuit_place",
        max: 1e-5,
        relative_l2: 1e-6,
        reason: "Logarithms of a size and of a ratio whose parts have 6e-8.",
        ..EXACT
    },
    Bound {
        stage: "bands_look",
        max: 2e-5,
        relative_l2: 1e-5,
        reason: "Sums of up to some dozens of terms of either sign, each within 6e-8 of the largest, and a quotient by a sum of weights.",
        ..EXACT
    },
    Bound {
        stage: "bands_fit",
        max: 1e-3,
        relative_l2: 1e-3,
        reason: "The ridge is 0.0016 of the weights, and the largest eigenvalue of the normal matrix at most 16/(4 pi) of them: a condition \
                 of 800, times hundreds of roundings of 6e-8 in the sums over views.",
        ..EXACT
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stage_has_one_bound_and_a_reason() {
        for (i, bound) in BOUNDS.iter().enumerate() {
            assert!(BOUNDS[..i].iter().all(|b| b.stage != bound.stage) && bound.reason.len() > 20, "{bound:?}");
        }
    }
}

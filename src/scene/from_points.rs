//! Initialises a scene from a point cloud, as in 3DGS (Kerbl 2023).

use std::num::NonZeroUsize;

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use super::{Gaussians, color};

/// The constant SH band's value.
pub const SH_DC: f32 = crate::stages::constants::constants::SH_C0;
/// Opacity of a new Gaussian.
const FIRST_OPACITY: f32 = 0.1;
/// Smallest mean squared distance, scene units²: coincident points still get a size.
const MIN_SQUARED_DISTANCE: f32 = 1e-7;

/// Makes one Gaussian for each point: isotropic, as wide as the root mean square distance to its three
/// nearest neighbours, with opacity 0.1 and its color in the constant band. `positions` and `colors` (8-bit
/// sRGB) have the same length.
pub fn from_points(positions: &[[f32; 3]], colors: &[[u8; 3]], sh_degree: u32) -> Gaussians {
    let n = positions.len();
    let model = color::of(sh_degree);
    let coefficients = model.coefficients;
    // A tree of fewer points than are asked for gives what it has; the point itself comes first.
    let neighbours = NonZeroUsize::new(4.min(n)).unwrap_or(NonZeroUsize::MIN);
    let tree = ImmutableKdTree::<f32, 3>::new_from_slice(positions).ok();
    let log_scale = |p: &[f32; 3]| {
        let found = tree.as_ref().map(|t| t.query(p).nearest_n::<SquaredEuclidean<f32>>(neighbours).execute());
        let squared: Vec<f32> = found.into_iter().flatten().skip(1).map(|item| item.distance).collect();
        let mean = squared.iter().sum::<f32>() / squared.len().max(1) as f32;
        0.5 * mean.max(MIN_SQUARED_DISTANCE).ln()
    };
    let coefficient = |at: usize| match at % coefficients {
        0 => [0.0; 3],
        k => (model.initial)(at / coefficients, k),
    };
    let mut sh: Vec<[f32; 3]> = (0..n * coefficients).map(coefficient).collect();
    for (i, color) in colors.iter().enumerate().take(n) {
        sh[i * coefficients] = color.map(|c| (f32::from(c) / 255.0 - 0.5) / SH_DC);
    }
    Gaussians {
        sh_degree,
        means: positions.to_vec(),
        log_scales: positions.par_iter().map(|p| [log_scale(p); 3]).collect(),
        quats: vec![[1.0, 0.0, 0.0, 0.0]; n],
        opacities: vec![(FIRST_OPACITY / (1.0 - FIRST_OPACITY)).ln(); n],
        sh,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_of_points_gets_its_spacing_as_scale() {
        let positions: Vec<[f32; 3]> = (0..125).map(|i| [i % 5, i / 5 % 5, i / 25].map(|c| c as f32 * 0.5)).collect();
        let mut colors = vec![[255, 0, 128]; 125];
        colors[124] = [51; 3];
        let scene = from_points(&positions, &colors, 1);
        assert_eq!((scene.len(), scene.sh.len()), (125, 500));
        // Every point has at least three neighbours at the spacing.
        assert!(scene.log_scales.iter().all(|s| (s[0] - 0.5f32.ln()).abs() < 1e-6 && s[0] == s[1]));
        assert!((scene.sh[0][0] * SH_DC + 0.5 - 1.0).abs() < 1e-6);
        assert!((scene.sh[124 * 4][1] * SH_DC + 0.5 - 0.2).abs() < 1e-6 && scene.sh[124 * 4 + 1] == [0.0; 3]);
    }

    #[test]
    fn none_one_and_coincident_points_have_finite_sizes() {
        for positions in [vec![], vec![[1.0; 3]], vec![[1.0; 3]; 100]] {
            let scene = from_points(&positions, &vec![[9; 3]; positions.len()], 0);
            assert!(scene.log_scales.iter().all(|s| s[0].is_finite()));
        }
    }
}

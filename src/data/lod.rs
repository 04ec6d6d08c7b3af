//! Coarser levels of detail: a scene with fewer Gaussians, each standing for one or several that were merged.
//!
//! Merging is greedy, cheapest pairs of neighbours first, and deterministic. A merged Gaussian has the mean, covariance and color of its
//! members, weighted by opacity times area, and the sum of that.

use std::num::NonZeroUsize;

use glam::{DMat3, DQuat, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use crate::scene::{Gaussians, eigen};

/// Neighbours with which a Gaussian may be merged in a round.
const NEIGHBOURS: usize = 8;
/// Weight of a squared difference of coefficients against one of means in units of their sizes.
const COLOR: f64 = 4.0;
/// Largest opacity of a merged Gaussian: beyond it a logit says little.
const OPAQUE: f64 = 0.999;

/// A Gaussian to merge.
#[derive(Debug, Clone, Copy)]
struct Splat {
    mean: DVec3,
    covariance: DMat3,
    /// Opacity times the mean area of its projections, up to a constant.
    mass: f64,
}

/// Merges Gaussians until `count` are left. Returns them, and for each Gaussian the number of the one that stands for it. All Gaussians
/// come back as they are if there are no more than `count`.
pub fn coarser(gaussians: &Gaussians, count: usize) -> (Gaussians, Vec<u32>) {
    let mut now = gaussians.clone();
    let mut splats: Vec<Splat> = (0..now.len()).into_par_iter().map(|i| Splat::of(&now, i)).collect();
    let mut stands_for: Vec<u32> = (0..now.len() as u32).collect();
    while now.len() > count.max(1) {
        let pairs = cheapest(&now, &splats, now.len() - count.max(1));
        let next = merged(&mut now, &mut splats, &pairs);
        stands_for.iter_mut().for_each(|of| *of = next[*of as usize]);
    }
    (now, stands_for)
}

/// Up to `most` pairs without a common member, cheapest first.
fn cheapest(gaussians: &Gaussians, splats: &[Splat], most: usize) -> Vec<[u32; 2]> {
    let near = NonZeroUsize::new((NEIGHBOURS + 1).min(splats.len())).unwrap_or(NonZeroUsize::MIN);
    let tree = ImmutableKdTree::<f32, 3>::new_from_slice(&gaussians.means).ok();
    let of = |i: usize| {
        let near = |tree: &ImmutableKdTree<f32, 3>| {
            tree.query(&gaussians.means[i]).nearest_n::<SquaredEuclidean<f32>>(near).execute()
        };
        let others = tree.iter().flat_map(near).map(|item| item.item as usize).filter(move |&other| other != i);
        others.map(move |other| [i.min(other) as u32, i.max(other) as u32]).collect::<Vec<_>>()
    };
    let mut pairs: Vec<[u32; 2]> = (0..splats.len()).into_par_iter().flat_map_iter(of).collect();
    pairs.par_sort_unstable();
    pairs.dedup();
    let k = gaussians.sh_coefficients();
    let color = |i: u32| &gaussians.sh[i as usize * k..][..k];
    let cost = |&[i, j]: &[u32; 2]| (splats[i as usize].cost(&splats[j as usize], color(i), color(j)), [i, j]);
    let mut costs: Vec<(f64, [u32; 2])> = pairs.par_iter().map(cost).collect();
    costs.par_sort_unstable_by(|(a, pair), (b, other)| a.total_cmp(b).then(pair.cmp(other)));
    let mut taken = vec![false; splats.len()];
    let free = |pair: &[u32; 2]| {
        let free = pair.iter().all(|&i| !taken[i as usize]);
        if free {
            pair.iter().for_each(|&i| taken[i as usize] = true);
        }
        free
    };
    let found: Vec<[u32; 2]> = costs.into_iter().map(|(_, pair)| pair).filter(free).take(most).collect();
    // Distances beyond float32 have no neighbours.
    if found.is_empty() { vec![[0, 1]] } else { found }
}

/// Merges each pair. Returns the new number of each Gaussian.
fn merged(gaussians: &mut Gaussians, splats: &mut Vec<Splat>, pairs: &[[u32; 2]]) -> Vec<u32> {
    let (n, k) = (splats.len(), gaussians.sh_coefficients());
    let mut partner = vec![u32::MAX; n];
    for &[i, j] in pairs {
        let (low, high) = (i as usize, j as usize);
        let [a, b] = [splats[low].mass, splats[high].mass];
        let share = if a + b > 0.0 { b / (a + b) } else { 0.5 };
        for c in 0..k {
            let other = gaussians.sh[high * k + c];
            let mix = |(a, b): (f32, f32)| (f64::from(a) + share * (f64::from(b) - f64::from(a))) as f32;
            let of = gaussians.sh[low * k + c];
            gaussians.sh[low * k + c] = std::array::from_fn(|channel| mix((of[channel], other[channel])));
        }
        splats[low] = splats[low].with(&splats[high], share);
        splats[low].put(gaussians, low);
        partner[high] = i;
    }
    let kept: Vec<usize> = (0..n).filter(|&i| partner[i] == u32::MAX).collect();
    let mut number = vec![0; n];
    kept.iter().zip(0..).for_each(|(&i, new)| number[i] = new);
    let next = (0..n).map(|i| number[if partner[i] == u32::MAX { i } else { partner[i] as usize }]).collect();
    *gaussians = gaussians.reordered(&kept);
    *splats = kept.iter().map(|&i| splats[i]).collect();
    next
}

impl Splat {
    fn of(gaussians: &Gaussians, i: usize) -> Splat {
        let opacity = 1.0 / (1.0 + (-f64::from(gaussians.opacities[i])).exp());
        Splat {
            mean: DVec3::from_array(gaussians.means[i].map(f64::from)),
            covariance: covariance(gaussians, i),
            mass: opacity * area(scales(gaussians, i)),
        }
    }

    /// How far apart two Gaussians are: the squared distance of their means in units of their sizes, and that of their colors in the mean
    /// over all directions. Weighing it with their masses gains nothing (docs/experiments/2026-11-28-lod.md).
    fn cost(&self, other: &Splat, color: &[[f32; 3]], others: &[[f32; 3]]) -> f64 {
        let offset = other.mean - self.mean;
        let both = self.covariance + other.covariance;
        let trace = both.x_axis.x + both.y_axis.y + both.z_axis.z;
        // A disc has no size across; an offset there counts as if it were a third as thick as wide.
        let thick = both + DMat3::from_diagonal(DVec3::splat(trace / 20.0 + f64::MIN_POSITIVE));
        let apart = offset.dot(thick.inverse() * offset);
        let squares = color
            .as_flattened()
            .iter()
            .zip(others.as_flattened())
            .map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
        // Parseval: over the sphere, harmonics have a mean square of the sum of their coefficients' squares over 4π.
        let colors = squares.sum::<f64>() / (4.0 * std::f64::consts::PI);
        apart + COLOR * colors
    }

    /// Both as one, with this share of `other`.
    fn with(&self, other: &Splat, share: f64) -> Splat {
        let offset = other.mean - self.mean;
        let spread = DMat3::from_cols(offset * offset.x, offset * offset.y, offset * offset.z);
        Splat {
            mean: self.mean + share * offset,
            covariance: self.covariance * (1.0 - share) + other.covariance * share + spread * (share * (1.0 - share)),
            mass: self.mass + other.mass,
        }
    }

    /// Stores geometry and opacity.
    fn put(&self, gaussians: &mut Gaussians, i: usize) {
        let m = self.covariance;
        let matrix = [m.x_axis.x, m.y_axis.y, m.z_axis.z, m.x_axis.y, m.x_axis.z, m.y_axis.z];
        let (variances, [x, y, z]) = eigen(matrix);
        let scales = DVec3::from_array(variances.map(|v| v.max(0.0).sqrt().max(f64::from(f32::MIN_POSITIVE))));
        let axes = if x.cross(y).dot(z) < 0.0 { DMat3::from_cols(x, y, -z) } else { DMat3::from_cols(x, y, z) };
        let quat = DQuat::from_mat3(&axes);
        gaussians.means[i] = self.mean.as_vec3().to_array();
        gaussians.log_scales[i] = scales.to_array().map(|v| v.ln() as f32);
        gaussians.quats[i] = [quat.w, quat.x, quat.y, quat.z].map(|v| v as f32);
        let opacity = (self.mass / area(scales)).clamp(f64::from(f32::MIN_POSITIVE), OPAQUE);
        gaussians.opacities[i] = (opacity / (1.0 - opacity)).ln() as f32;
    }
}

/// Standard deviations along the axes. Products of smaller and larger numbers would be 0 or infinite.
fn scales(gaussians: &Gaussians, i: usize) -> DVec3 {
    DVec3::from_array(gaussians.log_scales[i].map(|v| f64::from(v).clamp(-87.0, 88.0).exp()))
}

/// Covariance of a Gaussian in scene units.
pub(super) fn covariance(gaussians: &Gaussians, i: usize) -> DMat3 {
    let [w, x, y, z] = gaussians.quats[i].map(f64::from);
    let axes = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    let sized = axes * DMat3::from_diagonal(scales(gaussians, i));
    sized * sized.transpose()
}

/// The mean of the products of two scales. The mean area of an ellipsoid's projections is π times this for a ball, 1.5 π for a disc.
fn area(scales: DVec3) -> f64 {
    (scales.x * scales.y + scales.y * scales.z + scales.z * scales.x) / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::sample::random_scene;

    /// Two discs of radius 1 side by side, a third of twice the mass far away.
    fn three() -> Gaussians {
        Gaussians {
            sh_degree: 0,
            means: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [50.0, 0.0, 0.0]],
            log_scales: vec![[0.0, 0.0, -20.0]; 3],
            quats: vec![[2.0, 0.0, 0.0, 0.0]; 3],
            opacities: vec![0.0, (0.25f32 / 0.75).ln(), 0.0],
            sh: vec![[3.0; 3], [0.0; 3], [9.0; 3]],
        }
    }

    #[test]
    fn the_nearest_two_become_one_with_their_moments() {
        let (merged, stands_for) = coarser(&three(), 2);
        assert_eq!((stands_for, merged.means[1], merged.sh[1]), (vec![0, 0, 1], [50.0, 0.0, 0.0], [9.0; 3]));
        // Masses of 1/2 and 1/4: the second has a third.
        let near = |a: f32, b: f64| (f64::from(a) - b).abs() < 1e-6;
        assert!(near(merged.means[0][0], 1.0 / 3.0) && near(merged.sh[0][1], 2.0));
        // Variances of 1, and 2/9 more along x.
        let along = (11.0f64 / 9.0).sqrt();
        assert!(near(merged.log_scales[0][0], along.ln()) && near(merged.log_scales[0][1], 0.0));
        let opacity = 1.0 / (1.0 + (-f64::from(merged.opacities[0])).exp());
        assert!((opacity - 0.75 / along).abs() < 1e-6, "{opacity}");
    }

    #[test]
    fn masses_are_kept_and_nothing_depends_on_threads() {
        let scene = random_scene(5, 1000, 0, 2).base;
        let mass = |g: &Gaussians| (0..g.len()).map(|i| Splat::of(g, i).mass).sum::<f64>();
        let faint = Gaussians { opacities: vec![-5.0; 1000], ..scene.clone() };
        let (half, stands_for) = coarser(&faint, 500);
        assert_eq!((half.len(), stands_for.iter().max()), (500, Some(&499)));
        // None is opaque enough to be clamped; logits and scales are rounded to float32.
        assert!((mass(&half) / mass(&faint) - 1.0).abs() < 1e-5);
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(alone.install(|| coarser(&scene, 300)), coarser(&scene, 300));
        assert_eq!(coarser(&scene, 1000).0, scene);
    }

    #[test]
    fn one_place_far_places_and_none_are_merged() {
        for means in [vec![[1.0; 3]; 200], vec![[3e38, 0.0, 0.0], [-3e38, 0.0, 0.0], [0.0, 3e38, 1.0]], vec![]] {
            let n = means.len();
            let scene = Gaussians {
                means,
                log_scales: vec![[-200.0, 90.0, 1.0]; n],
                quats: vec![[1.0, 0.0, 0.0, 0.0]; n],
                opacities: vec![9.0; n],
                sh: vec![[f32::MAX, f32::MIN, 0.0]; n],
                sh_degree: 0,
            };
            let (merged, stands_for) = coarser(&scene, 1);
            assert_eq!((merged.len(), stands_for.len()), (n.min(1), n));
            let numbers =
                merged.means.iter().chain(&merged.log_scales).chain(&merged.sh).flatten().chain(&merged.opacities);
            assert!(numbers.chain(merged.quats.iter().flatten()).all(|v| v.is_finite()));
        }
    }
}

//! Separates foreground from background: single-linkage clustering of each set of points (method, section 4.2
//! and 4.3; Sibson 1973). Clusters are the connected components of the graph that joins points strictly
//! closer than τ, in rounds of growing τ.

use super::{
    lift_groups::{LiftClusters, lift_groups},
    lift_join::lift_join,
};
use crate::stages::constants::cluster::MAX_GROWTHS;

/// Clusters each set. `fail_on_smallest` ⚖: a set fails if its smallest group has fewer than 3 points, not
/// its largest.
pub fn lift_cluster(
    points: &[[f64; 4]],
    counts: &[u32],
    firsts: &[u32],
    heaviest: &[u32],
    start_taus: &[f64],
    fail_on_smallest: bool,
) -> LiftClusters {
    let mut clusters = LiftClusters {
        labels: vec![0; points.len()],
        taus: start_taus.to_vec(),
        prime_labels: vec![0; counts.len()],
        cluster_sizes: vec![0; counts.len()],
    };
    for (&n, &first) in counts.iter().zip(firsts) {
        for i in 0..n {
            clusters.labels[(first + i) as usize] = i;
        }
    }
    for round in 0..=MAX_GROWTHS {
        let LiftClusters { labels, taus, cluster_sizes, .. } = &mut clusters;
        lift_join(points, counts, firsts, taus, cluster_sizes, labels);
        if !lift_groups(counts, firsts, heaviest, &mut clusters, fail_on_smallest, round == MAX_GROWTHS) {
            break;
        }
    }
    clusters
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::lift_join::components;
    use proptest::prelude::*;

    fn distance2(a: &[f64; 4], b: &[f64; 4]) -> f64 {
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum()
    }

    /// Single linkage by its definition: the two closest clusters are merged until none are closer than τ. O(n³).
    fn single_linkage(tau: f64, points: &[[f64; 4]]) -> Vec<u32> {
        let mut clusters: Vec<Vec<usize>> = (0..points.len()).map(|i| vec![i]).collect();
        loop {
            let mut closest = (f64::INFINITY, 0, 0);
            for a in 0..clusters.len() {
                for b in 0..a {
                    for &i in &clusters[a] {
                        for &j in &clusters[b] {
                            let d = distance2(&points[i], &points[j]);
                            if d < closest.0 {
                                closest = (d, a, b);
                            }
                        }
                    }
                }
            }
            if closest.0 >= tau * tau {
                break;
            }
            let absorbed = clusters.remove(closest.1);
            clusters[closest.2].extend(absorbed);
        }
        let mut labels = vec![0; points.len()];
        for cluster in clusters {
            let first = *cluster.iter().min().unwrap();
            for i in cluster {
                labels[i] = first as u32;
            }
        }
        labels
    }

    fn one(points: &[[f64; 4]], heaviest: u32, tau: f64, fail_on_smallest: bool) -> LiftClusters {
        lift_cluster(points, &[points.len() as u32], &[0], &[heaviest], &[tau], fail_on_smallest)
    }

    fn at(x: f64, y: f64) -> [f64; 4] {
        [x, y, 0.0, 1.0]
    }

    proptest! {
        /// Anywhere, and on a small integer grid, on which most distances occur often, points coincide, and many
        /// are exactly τ apart (3-4-5).
        #[test]
        fn components_are_single_linkage_cut_at_tau(
            points in prop::collection::vec((0.0..10.0f64, 0.0..10.0f64, 0.0..3.0f64), 0..40), tau in 0.1..6.0f64,
        ) {
            let grid = points.iter().map(|&(x, y, _)| at(x.floor(), y.floor())).collect::<Vec<_>>();
            let points = points.into_iter().map(|(x, y, z)| [x, y, z, 1.0]).collect::<Vec<_>>();
            for (tau, points) in [(tau, points), (tau.ceil(), grid)] {
                prop_assert_eq!(components(tau, &points), single_linkage(tau, &points));
            }
        }

        #[test]
        fn the_first_tau_that_does_not_fail_is_taken(
            points in prop::collection::vec((0.0..100.0f64, 0.0..100.0f64), 3..30), fail_on_smallest: bool,
        ) {
            let points: Vec<_> = points.into_iter().map(|(x, y)| at(x, y)).collect();
            let got = one(&points, 0, 0.5, fail_on_smallest);
            let mut tau = 0.5;
            loop {
                let labels = single_linkage(tau, &points);
                let sizes: Vec<usize> =
                    (0..points.len() as u32).map(|l| labels.iter().filter(|&&m| m == l).count()).filter(|&s| s > 0).collect();
                let size = if fail_on_smallest { sizes.iter().min() } else { sizes.iter().max() };
                if *size.unwrap() >= 3 {
                    prop_assert_eq!(&got.labels, &labels);
                    break;
                }
                tau *= 1.5;
            }
            prop_assert_eq!(got.taus[0], tau);
            let prime = got.prime_labels[0];
            prop_assert_eq!(got.cluster_sizes[0] as usize, got.labels.iter().filter(|&&l| l == prime).count());
        }
    }

    #[test]
    fn the_prime_group_is_the_heaviest_points_if_it_has_three() {
        let mut points = vec![at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0)];
        points.extend([at(50.0, 0.0), at(51.0, 0.0), at(50.0, 1.0), at(51.0, 1.0)]);
        points.push(at(99.0, 99.0));
        let got = one(&points, 1, 1.2, false);
        assert_eq!((got.prime_labels[0], got.cluster_sizes[0]), (0, 3));
        let got = one(&points, 7, 1.2, false);
        assert_eq!((got.prime_labels[0], got.cluster_sizes[0]), (3, 4));
        // The lone point makes the smallest group fail until all are one: 1.2·1.5^n > 110.
        let got = one(&points, 7, 1.2, true);
        assert_eq!((got.prime_labels[0], got.cluster_sizes[0]), (0, 8));
    }
}

//! Twin of `lift_groups.comp`: evaluates the components of each open set and selects its prime group (method,
//! section 4.2 and 4.3).

use super::lift_join::find;

/// Growth of τ while clustering fails.
pub const TAU_GROWTH: f64 = 1.5;
/// Points that PCA needs.
pub const GROUP_MIN: u32 = 3;

/// State and result of clustering.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LiftClusters {
    /// Per point: index within its set of the first point of its component.
    pub labels: Vec<u32>,
    /// Per set: the τ at which clustering succeeded, or the last one tried.
    pub taus: Vec<f64>,
    /// Per set: label of the prime group, the one of the heaviest point if it has 3 points or more, else the largest (ties:
    /// the smallest label). 0 while there is none.
    pub prime_labels: Vec<u32>,
    /// Per set: points of the prime group; 0: no lift.
    pub cluster_sizes: Vec<u32>,
}

/// True if a set is still to be clustered.
pub fn is_open(points: u32, tau: f64, cluster_size: u32) -> bool {
    cluster_size == 0 && points >= GROUP_MIN && tau > 0.0 && tau <= 1e18
}

/// Returns true if a set failed and needs another round. Its τ has then grown, unless this is the `last`
/// round. `fail_on_smallest` ⚖: a set fails if its smallest group has fewer than 3 points, not its largest.
pub fn lift_groups(
    counts: &[u32],
    firsts: &[u32],
    heaviest: &[u32],
    clusters: &mut LiftClusters,
    fail_on_smallest: bool,
    last: bool,
) -> bool {
    let mut failed = false;
    for set in 0..counts.len() {
        let n = counts[set];
        if !is_open(n, clusters.taus[set], clusters.cluster_sizes[set]) {
            continue;
        }
        let labels = &mut clusters.labels[firsts[set] as usize..(firsts[set] + n) as usize];
        let mut sizes = vec![0; n as usize];
        for i in 0..n {
            labels[i as usize] = find(labels, i);
            sizes[labels[i as usize] as usize] += 1;
        }
        let most = sizes.iter().copied().max().unwrap_or(0);
        let fewest = sizes.iter().copied().filter(|&s| s > 0).min().unwrap_or(0);
        if if fail_on_smallest { fewest } else { most } < GROUP_MIN {
            if !last {
                clusters.taus[set] *= TAU_GROWTH;
                failed = true;
            }
            continue;
        }
        let centre = labels[heaviest[set].min(n - 1) as usize];
        let prime = if sizes[centre as usize] >= GROUP_MIN {
            centre
        } else {
            sizes.iter().position(|&s| s == most).unwrap_or(0) as u32
        };
        clusters.prime_labels[set] = prime;
        clusters.cluster_sizes[set] = sizes[prime as usize];
    }
    failed
}

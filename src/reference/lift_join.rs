//! Twin of `lift_join.comp`: joins the points of each open set that are strictly closer than the set's τ
//! (method, section 4.2).

use super::lift_groups::is_open;

/// The root of x, halving the path. A joined component keeps the smaller root, so a root is its component's
/// first point.
pub fn find(labels: &mut [u32], mut x: u32) -> u32 {
    while labels[x as usize] != x {
        labels[x as usize] = labels[labels[x as usize] as usize];
        x = labels[x as usize];
    }
    x
}

fn join_closer_than(tau: f64, points: &[[f64; 4]], labels: &mut [u32]) {
    for i in 0..points.len() {
        for j in 0..i {
            let d = [0, 1, 2].map(|k| points[i][k] - points[j][k]);
            if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < tau * tau {
                let (a, b) = (find(labels, i as u32), find(labels, j as u32));
                labels[a.max(b) as usize] = a.min(b);
            }
        }
    }
}

/// Components of one set at τ: for each point, the first member of its component.
pub fn components(tau: f64, points: &[[f64; 4]]) -> Vec<u32> {
    let mut labels: Vec<u32> = (0..points.len() as u32).collect();
    join_closer_than(tau, points, &mut labels);
    (0..points.len() as u32).map(|i| find(&mut labels, i)).collect()
}

/// Joins all close pairs of every open set. `labels` holds an ancestor of each point, initially the point
/// itself.
pub fn lift_join(
    points: &[[f64; 4]],
    counts: &[u32],
    firsts: &[u32],
    taus: &[f64],
    cluster_sizes: &[u32],
    labels: &mut [u32],
) {
    for set in 0..counts.len() {
        if is_open(counts[set], taus[set], cluster_sizes[set]) {
            let range = firsts[set] as usize..(firsts[set] + counts[set]) as usize;
            join_closer_than(taus[set], &points[range.clone()], &mut labels[range]);
        }
    }
}

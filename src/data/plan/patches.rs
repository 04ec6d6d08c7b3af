//! Patches: sparse points in small groups.

use glam::DVec3;

/// Maximum number of points of a patch (Spirula's notes on partitions have 24).
const POINTS: usize = 24;

/// Points close to each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Patch {
    /// Mean of its points, world.
    pub(super) center: DVec3,
    /// Root mean square distance of its points from the center.
    pub(super) radius: f64,
    /// Number of points.
    pub(super) points: u32,
}

/// Groups `points` (world) by halving the longer side again and again, at the median. Patches that follow each other are close to each
/// other.
pub(super) fn patches(points: &[[f64; 3]]) -> Vec<Patch> {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    let mut found = Vec::with_capacity(2 * points.len() / POINTS + 1);
    if !points.is_empty() {
        halve(points, &mut order, &mut found);
    }
    found
}

fn halve(points: &[[f64; 3]], of: &mut [u32], found: &mut Vec<Patch>) {
    let at = |i: u32| DVec3::from_array(points[i as usize]);
    if of.len() <= POINTS {
        let n = of.len() as f64;
        let center = of.iter().map(|&i| at(i)).sum::<DVec3>() / n;
        let squared = of.iter().map(|&i| at(i).distance_squared(center)).sum::<f64>() / n;
        found.push(Patch { center, radius: squared.sqrt(), points: of.len() as u32 });
        return;
    }
    let (low, high) = of.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &i| {
        let p = at(i);
        (low.min(p), high.max(p))
    });
    let side = high - low;
    let axis = (0..3).max_by(|&a, &b| side[a].total_cmp(&side[b])).unwrap_or(0);
    // Numbers of points decide among equal coordinates.
    let middle = of.len() / 2;
    of.select_nth_unstable_by(middle, |&a, &b| at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(&b)));
    let (left, right) = of.split_at_mut(middle);
    halve(points, left, found);
    halve(points, right, found);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_point_is_in_one_small_patch_of_its_neighbours() {
        let points: Vec<[f64; 3]> = (0..1000).map(|i| [f64::from(i % 100), f64::from(i / 100 % 10), 0.0]).collect();
        let found = patches(&points);
        assert_eq!(found.iter().map(|patch| patch.points).sum::<u32>(), 1000);
        assert!(found.iter().all(|patch| (13..=24).contains(&patch.points)), "{found:?}");
        // 1,000 points of an area of 1 each: no patch is wider than twice a square of 24.
        assert!(found.iter().all(|patch| patch.radius < 5.0));
        assert_eq!(patches(&[[7.0; 3]; 60]).len(), 4);
        assert_eq!(patches(&[]), []);
    }
}

//! Which part a place belongs to.

use std::cmp::Ordering;
use std::num::NonZeroUsize;

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::Part;

/// Number of nearest seeds whose distances are compared with their orientation.
const NEAREST: NonZeroUsize = NonZeroUsize::new(8).expect("8 is not 0");
/// A place behind a seed's surface counts as this many times farther from that surface: the other side of a wall belongs to the seeds
/// there (8, as in Spirula's notes on partitions).
const BEHIND: f64 = 8.0;

/// The seeds of all parts.
pub struct Owners {
    tree: Option<ImmutableKdTree<f64, 3>>,
    seeds: Vec<[f64; 6]>,
    /// By part, number of its first seed.
    firsts: Vec<u32>,
}

impl Owners {
    /// Those of a plan's parts.
    pub fn of(parts: &[Part]) -> Owners {
        let mut firsts = Vec::with_capacity(parts.len());
        let mut seeds: Vec<[f64; 6]> = Vec::new();
        for part in parts {
            firsts.push(seeds.len() as u32);
            seeds.extend(&part.seeds);
        }
        let at: Vec<[f64; 3]> = seeds.iter().map(|&[x, y, z, ..]| [x, y, z]).collect();
        Owners { tree: ImmutableKdTree::new_from_slice(&at).ok(), seeds, firsts }
    }

    /// Number of the seed that a place (world) belongs to, in the sequence of all parts' seeds; 0 for a place that is not finite.
    pub fn seed(&self, at: [f64; 3]) -> u32 {
        let distances = self.nearest(at).map(|seed| (self.distance(seed, at), seed));
        distances.min_by(order).map_or(0, |(_, seed)| seed)
    }

    /// The part of a place (world).
    pub fn part(&self, at: [f64; 3]) -> u32 {
        self.part_of(self.seed(at))
    }

    fn part_of(&self, seed: u32) -> u32 {
        self.firsts.partition_point(|&first| first <= seed).saturating_sub(1) as u32
    }

    /// The part of a place (world), and whether the place is next to another part: one of that part's seeds is less than twice as far as
    /// the nearest.
    pub fn part_and_seam(&self, at: [f64; 3]) -> (u32, bool) {
        let near: Vec<(f64, u32)> = self.nearest(at).map(|seed| (self.distance(seed, at), seed)).collect();
        let first = near.iter().copied().min_by(order);
        let part = self.part_of(first.map_or(0, |(_, seed)| seed));
        let is_other = |&(distance, seed): &(f64, u32)| {
            first.is_some_and(|(own, _)| distance < 4.0 * own) && self.part_of(seed) != part
        };
        (part, near.iter().any(is_other))
    }

    /// The nearest seeds, without regard to their orientation.
    fn nearest(&self, at: [f64; 3]) -> impl Iterator<Item = u32> {
        let tree = self.tree.as_ref().filter(|_| at.iter().all(|v| v.is_finite()));
        let most = NEAREST.min(NonZeroUsize::new(self.seeds.len()).unwrap_or(NEAREST));
        let found = tree.map(|tree| tree.query(&at).nearest_n::<SquaredEuclidean<f64>>(most).execute());
        found.into_iter().flatten().map(|found| found.item)
    }

    /// Squared distance of a place from a seed.
    fn distance(&self, seed: u32, at: [f64; 3]) -> f64 {
        let [x, y, z, normal @ ..] = self.seeds[seed as usize];
        let from = DVec3::from_array(at) - DVec3::new(x, y, z);
        let behind = from.dot(DVec3::from_array(normal)).min(0.0);
        from.length_squared() + (BEHIND * BEHIND - 1.0) * behind * behind
    }
}

/// Orders seeds by distance, and equally near ones by number.
fn order(a: &(f64, u32), b: &(f64, u32)) -> Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::super::Part;
    use super::*;

    fn owners(parts: &[&[[f64; 6]]]) -> Owners {
        Owners::of(&parts.iter().map(|seeds| Part { seeds: seeds.to_vec(), ..Part::default() }).collect::<Vec<_>>())
    }

    #[test]
    fn a_place_belongs_to_the_nearest_seed_whose_side_it_is_on() {
        // Two sides of a wall at x = 0, 0.02 thick; a third part is empty, a fourth is far away.
        let found = owners(&[
            &[[0.01, 0.0, 0.0, 1.0, 0.0, 0.0], [0.01, 1.0, 0.0, 1.0, 0.0, 0.0]],
            &[[-0.01, 0.0, 0.0, -1.0, 0.0, 0.0]],
            &[],
            &[[9.0, 0.0, 0.0, 0.0, 0.0, 1.0]],
        ]);
        assert_eq!([0.02, 0.004, -0.004, -0.3].map(|x| found.part([x, 0.1, 0.0])), [0, 0, 1, 1]);
        assert_eq!(found.seed([0.3, 0.9, 0.0]), 1);
        assert_eq!((found.part([8.0, 0.0, 0.5]), found.seed([8.0, 0.0, 0.5])), (3, 3));
        // Behind a surface only the distance from the surface counts more, not that along it.
        assert_eq!(found.part([4.4, 0.0, -0.1]), 0);
        assert_eq!(found.part([f64::NAN, 0.0, 0.0]), 0);
        assert_eq!(owners(&[]).part([0.0; 3]), 0);
    }
}

//! Twin of `recount.comp`: the first index of each segment and the dispatches over its pages.

use super::dispatch_args::dispatch_args;
use crate::stages::{
    constants::population::SEGMENTS,
    status::{Resource, Status},
    types::Page,
};

/// Results derived from the segments' counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Recounted {
    /// Clamped to the pages' capacity.
    pub counts: [u32; SEGMENTS as usize],
    /// Index of each segment's first Gaussian, and the number of all.
    pub population: [u32; SEGMENTS as usize + 1],
    /// Workgroups: for each page, then for the blocks up to the end of each segment.
    pub args: Vec<u32>,
    /// Reports segments that exceed their capacity.
    pub status: Status,
}

/// Computes them. `counts` are not yet clamped to the capacity.
pub fn recount(
    counts: [u32; SEGMENTS as usize],
    pages: &[Page],
    threads_per_group: u32,
    items_per_group: u32,
    mut status: Status,
) -> Recounted {
    let capacity = |s: usize| pages.iter().filter(|p| p.segment == s as u32).map(|p| p.capacity).sum::<u32>();
    let mut kept = counts;
    let mut population = [0; SEGMENTS as usize + 1];
    for s in 0..counts.len() {
        kept[s] = counts[s].min(capacity(s));
        if kept[s] < counts[s] {
            status.fail(Resource::ALL[Resource::BaseGaussians as usize + s], counts[s]);
        }
        population[s + 1] = population[s] + kept[s];
    }
    let groups = |items: u32, per_group: u32| dispatch_args(items, u32::MAX, per_group).2;
    let here = |page: &Page| kept[page.segment as usize].saturating_sub(page.first).min(page.capacity);
    let of_pages = pages.iter().flat_map(|page| groups(here(page), threads_per_group));
    let of_blocks = population[1..].iter().flat_map(|&end| groups(end, items_per_group));
    Recounted { counts: kept, population, args: of_pages.chain(of_blocks).collect(), status }
}

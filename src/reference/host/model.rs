//! Host adapters of the twins that count and move Gaussians.

use super::Outcome;
use crate::{
    reference::{self as twin, NONE, recount::Recounted},
    stages::{kernels, status::Status},
};

twins!(gather, recount);

pub(super) fn recount(h: kernels::recount::Host<'_>) -> Outcome {
    let kernels::recount::Push { page_count, threads_per_group, items_per_group, segment, added_index } = h.push;
    let mut counts = std::array::from_fn(|s| h.segment_counts[s]);
    if added_index != NONE {
        let count: &mut u32 = &mut counts[segment as usize];
        *count = count.saturating_add(h.added[added_index as usize]);
    }
    let pages = &h.pages[..page_count as usize];
    let Recounted { counts, population, args, status } =
        twin::recount::recount(counts, pages, threads_per_group, items_per_group, Status::read(h.status));
    h.segment_counts[..counts.len()].copy_from_slice(&counts);
    h.population[..population.len()].copy_from_slice(&population);
    h.population_args[..args.len()].copy_from_slice(&args);
    h.status[..status.0.len()].copy_from_slice(&status.0);
    Ok(())
}

pub(super) fn gather(h: kernels::gather::Host<'_>) -> Outcome {
    let kernels::gather::Push { count_index, targets, page_first, stride, quad } = h.push;
    let count = h.workgroups.threads().min(h.count[count_index as usize].min(targets) as usize);
    // Targets whose source is in this page, and its place there. The first page handles targets that start at
    // 0.
    let place = |&source: &u32| match source {
        NONE => (page_first == 0).then_some(NONE),
        _ => source.checked_sub(page_first).filter(|&place| place < stride),
    };
    let (here, places): (Vec<usize>, Vec<u32>) =
        h.sources[..count].iter().enumerate().filter_map(|(target, source)| Some((target, place(source)?))).unzip();
    let quads = &h.from[quad as usize * stride as usize..][..stride as usize];
    for (target, value) in here.into_iter().zip(twin::gather::gather(quads, &places)) {
        h.gathered[target] = value;
    }
    Ok(())
}

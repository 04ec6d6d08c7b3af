//! Drops, reorders and duplicates the Gaussians of a model.

use super::{Model, Planes, Quads, Segment};
use crate::{
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    scene::layout,
    stages::{WORKGROUP, dispatch_args, gather},
};

/// Rearranges the Gaussians of a segment: they can be dropped, reordered or duplicated.
pub struct Rearrange {
    gather: gather::Stage,
    dispatch_args: dispatch_args::Stage,
    args: Buffer<u32>,
    gathered: Quads,
    targets: u32,
}

/// New arrangement of a segment's Gaussians.
#[derive(Clone, Copy)]
pub struct Sources<'a> {
    /// Old number by new number; [`NONE`](crate::stages::constants::constants::NONE) sets all planes to 0.
    pub sources: &'a Buffer<u32>,
    /// Word `index` of `count` is the new number of Gaussians.
    pub count: &'a Buffer<u32>,
    /// See `count`.
    pub index: u32,
}

impl Rearrange {
    /// Rearranges into up to `targets` Gaussians.
    pub fn new(context: &Context, targets: u32) -> Result<Self, GpuError> {
        Self::with(context, targets, Buffer::new(context, "gathered", targets as usize, Location::Device)?)
    }

    /// [`Rearrange::new`] with the caller's scratch buffer `gathered`, one quad per Gaussian.
    pub(in crate::pipelines) fn with(context: &Context, targets: u32, gathered: Quads) -> Result<Self, GpuError> {
        Ok(Rearrange {
            gather: gather::Stage::new(context, &gather::Spec { workgroup_size: context.info().workgroup(WORKGROUP) })?,
            dispatch_args: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 })?,
            args: Buffer::new(context, "rearrange_args", 3, Location::Device)?,
            gathered,
            targets,
        })
    }

    /// Rearranges the Gaussians of `segment`, together with their planes in `others` (moments). A count
    /// beyond the room is clamped and reported in `status`.
    pub fn record(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        segment: Segment,
        from: Sources<'_>,
        others: &[&Planes],
        status: &Buffer<u32>,
    ) {
        let part = model.part(segment);
        let Sources { sources, count: words, index: count_index } = from;
        self.dispatch_args.record(
            recorder,
            &dispatch_args::Buffers { count: words, dispatch_args: &self.args, status },
            &dispatch_args::Push {
                count_index,
                capacity: self.targets.min(part.capacity()),
                items_per_group: self.gather.workgroup_size(),
                args_index: 0,
                resource_index: segment.resource().index(),
            },
            1,
        );
        for planes in [&part.geometry, &part.sh, &part.lobes].into_iter().chain(others.iter().copied()) {
            for quad in 0..layout::quads(planes.planes()) {
                for (k, page) in part.pages.iter().enumerate() {
                    let push = gather::Push {
                        count_index,
                        targets: self.targets,
                        page_first: page.first,
                        stride: page.capacity,
                        quad: quad as u32,
                    };
                    let buffers =
                        gather::Buffers { count: words, sources, from: planes.page(k), gathered: &self.gathered };
                    self.gather.record_indirect(recorder, &buffers, &push, &self.args, 0);
                }
                for (k, page) in part.pages.iter().enumerate().filter(|(_, page)| page.first < self.targets) {
                    let n = page.capacity.min(self.targets - page.first) as usize;
                    let to = quad * page.capacity as usize;
                    recorder.copy(&self.gathered, page.first as usize, planes.page(k), to, n);
                }
            }
        }
        recorder.copy(words, count_index as usize, &model.segment_counts, segment as usize, 1);
        model.record_recount(recorder, None, status);
    }
}

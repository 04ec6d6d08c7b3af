//! Records an exclusive prefix sum and a radix sort, each a sequence of kernels.

use crate::{
    gpu::{Buffer, Context, GpuError, Recorder},
    stages::{
        blocks::{Blocks, SPINE_WORKGROUP},
        radix_downsweep, radix_spine, radix_upsweep, scan_apply, scan_reduce, scan_spine,
    },
};

/// Number of items, with a dispatch of workgroups over them: `count[index]` and dispatch `dispatch` of
/// `args`. `dispatch_args` makes it with [`items_per_group`](crate::stages::blocks::items_per_group).
#[derive(Clone, Copy)]
pub struct Extent<'a> {
    /// Word `index` is the number of items.
    pub count: &'a Buffer<u32>,
    /// See `count`.
    pub index: u32,
    /// Dispatch `dispatch` has a workgroup for each block of items.
    pub args: &'a Buffer<u32>,
    /// See `args`.
    pub dispatch: u32,
}

/// Exclusive prefix sum of u32.
pub struct Scan {
    gather: bool,
    reduce: scan_reduce::Stage,
    spine: scan_spine::Stage,
    apply: scan_apply::Stage,
}

/// Inputs and outputs of a scan.
#[derive(Clone, Copy)]
pub struct ScanBuffers<'a> {
    /// Values to add up; sums saturate at 2^32 − 1.
    pub values: &'a Buffer<u32>,
    /// Item i is `values[index[i]]`; `None` for a scan without gather.
    pub index: Option<&'a Buffer<u32>>,
    /// Scratch, [`block_sums_len`](crate::stages::blocks::block_sums_len) elements.
    pub block_sums: &'a Buffer<u32>,
    /// Output: the prefix sum of each item, in the order of the items.
    pub offsets: &'a Buffer<u32>,
}

impl Scan {
    /// With `gather`, values are read through an index.
    pub fn new(context: &Context, gather: bool) -> Result<Self, GpuError> {
        let Blocks { block, workgroup: workgroup_size, .. } = Blocks::of(context.info());
        let spine = scan_spine::Spec { workgroup_size: SPINE_WORKGROUP.min(context.info().max_workgroup), block };
        Ok(Scan {
            gather,
            reduce: scan_reduce::Stage::new(context, &scan_reduce::Spec { workgroup_size, block, gather })?,
            spine: scan_spine::Stage::new(context, &spine)?,
            apply: scan_apply::Stage::new(context, &scan_apply::Spec { workgroup_size, block, gather })?,
        })
    }

    /// Records the scan. The total goes to `extent.count[total_index]`, which must not be `extent.index`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &ScanBuffers<'_>, extent: Extent<'_>, total_index: u32) {
        let ScanBuffers { values, block_sums, offsets, .. } = *buffers;
        let index = buffers.index.unwrap_or(values);
        debug_assert_eq!(self.gather, buffers.index.is_some());
        let Extent { count, index: count_index, args, dispatch } = extent;
        self.reduce.record_indirect(
            recorder,
            &scan_reduce::Buffers { count, values, index, block_sums },
            &scan_reduce::Push { count_index },
            args,
            dispatch,
        );
        self.spine.record(
            recorder,
            &scan_spine::Buffers { count, block_sums },
            &scan_spine::Push { count_index, total_index },
            1,
        );
        self.apply.record_indirect(
            recorder,
            &scan_apply::Buffers { count, values, index, block_sums, offsets },
            &scan_apply::Push { count_index },
            args,
            dispatch,
        );
    }
}

/// Kind of input of a [`RadixSort`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// Pairs, all kept.
    All,
    /// Pairs; drops those with key `0xFFFFFFFF`.
    Some,
    /// Keys only; drops those equal to `0xFFFFFFFF`. The value of a key is its index.
    Keys,
}

/// Stable sort of (key, value) pairs, least significant digit first.
pub struct RadixSort {
    passes: u32,
    digit_bits: u32,
    compact: Option<(radix_upsweep::Stage, radix_downsweep::Stage)>,
    upsweep: radix_upsweep::Stage,
    spine: radix_spine::Stage,
    /// Workgroups of the spine: one lane per digit.
    spine_groups: u32,
    downsweep: radix_downsweep::Stage,
}

/// Keys with their values.
#[derive(Clone, Copy)]
pub struct Pairs<'a> {
    /// Sorted in ascending order; equal keys keep their order.
    pub keys: &'a Buffer<u32>,
    /// Permuted together with the keys.
    pub values: &'a Buffer<u32>,
}

/// Scratch of a radix sort.
#[derive(Clone, Copy)]
pub struct RadixScratch<'a> {
    /// [`block_counts_len`](crate::stages::blocks::block_counts_len) elements.
    pub block_counts: &'a Buffer<u32>,
    /// [`DIGIT_TOTALS`](crate::stages::blocks::DIGIT_TOTALS) elements.
    pub digit_totals: &'a Buffer<u32>,
}

impl RadixSort {
    /// Sorts keys below 2^`key_bits` (1 to 32).
    pub fn new(context: &Context, key_bits: u32, input: Input) -> Result<Self, GpuError> {
        let blocks = Blocks::of(context.info());
        let (passes, digit_bits) = blocks.passes_for(key_bits);
        let Blocks { block, workgroup: workgroup_size, .. } = blocks;
        let constant_lanes = context.info().constant_lanes().unwrap_or(0);
        let (row_lanes, lockstep) = (context.info().subgroup_size, context.info().lockstep);
        let upsweep = |compact| {
            let spec = radix_upsweep::Spec { workgroup_size, block, digit_bits, row_lanes, compact, lockstep };
            radix_upsweep::Stage::new(context, &spec)
        };
        let downsweep = |compact, indexed| {
            let lanes = constant_lanes;
            radix_downsweep::Stage::new(
                context,
                &radix_downsweep::Spec {
                    workgroup_size,
                    block,
                    digit_bits,
                    row_lanes,
                    compact,
                    lanes,
                    indexed,
                    lockstep,
                },
            )
        };
        let (lanes, most) = (context.info().subgroup_size, context.info().max_workgroup.min(1024));
        // A spine's workgroup has a column of counters per lane, so there are few workgroups. A GPU needs
        // many subgroups in each to hide the latency; most allow up to 1024 threads. On a CPU each subgroup
        // is only a cost.
        let spine_size = if context.info().is_cpu { lanes } else { (lanes * 32).min(most) };
        Ok(RadixSort {
            passes,
            digit_bits,
            compact: match input {
                Input::All => None,
                Input::Some | Input::Keys => Some((upsweep(true)?, downsweep(true, input == Input::Keys)?)),
            },
            upsweep: upsweep(false)?,
            spine: radix_spine::Stage::new(
                context,
                &radix_spine::Spec { workgroup_size: spine_size, block, digit_bits },
            )?,
            spine_groups: (1u32 << digit_bits).div_ceil(lanes),
            downsweep: downsweep(false, false)?,
        })
    }

    /// Index of the pair in [`RadixSort::record`] that receives the sorted result.
    pub fn last_pair(&self) -> usize {
        (self.passes as usize + 1) % 2
    }

    /// Pass p writes `pairs[p % 2]`; returns the last pair written, which is sorted. `input` may be
    /// `pairs[1]` if it is not needed any more. A sort of [`Input::Keys`] does not read `input.values`. A
    /// sort that drops keys writes the number of remaining pairs to `extent.count[kept_index]`, which must
    /// not be `extent.index`; others ignore `kept_index`.
    pub fn record<'a>(
        &self,
        recorder: &mut Recorder,
        input: Pairs<'a>,
        pairs: [Pairs<'a>; 2],
        scratch: RadixScratch<'_>,
        extent: Extent<'_>,
        kept_index: u32,
    ) -> Pairs<'a> {
        let RadixScratch { block_counts, digit_totals } = scratch;
        let Extent { count, index, args, dispatch } = extent;
        let (mut count_index, mut from) = (index, input);
        for pass in 0..self.passes {
            let shift = pass * self.digit_bits;
            let to = pairs[pass as usize % 2];
            let (upsweep, downsweep) = match (&self.compact, pass) {
                (Some((upsweep, downsweep)), 0) => (upsweep, downsweep),
                _ => (&self.upsweep, &self.downsweep),
            };
            let buffers = radix_upsweep::Buffers { count, keys_in: from.keys, block_counts };
            upsweep.record_indirect(recorder, &buffers, &radix_upsweep::Push { count_index, shift }, args, dispatch);
            let buffers = radix_spine::Buffers { count, block_counts, digit_totals };
            self.spine.record(recorder, &buffers, &radix_spine::Push { count_index }, self.spine_groups);
            let buffers = radix_downsweep::Buffers {
                count,
                keys_in: from.keys,
                values_in: from.values,
                block_counts,
                digit_totals,
                keys_out: to.keys,
                values_out: to.values,
            };
            let push = radix_downsweep::Push { count_index, kept_index, shift };
            downsweep.record_indirect(recorder, &buffers, &push, args, dispatch);
            // From here on, workgroups beyond the smaller count have nothing to do.
            if self.compact.is_some() {
                count_index = kept_index;
            }
            from = to;
        }
        from
    }
}

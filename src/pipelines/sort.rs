//! The order of the kernels of an exclusive prefix sum and of a radix sort. Records only.

use crate::{
    gpu::{Buffer, Context, GpuError, Recorder},
    stages::{
        radix_downsweep::{self, RadixDownsweep},
        radix_spine::{self, RadixSpine},
        radix_upsweep::{self, RadixUpsweep, passes_for},
        scan_apply::{self, ScanApply},
        scan_reduce::{self, ScanReduce},
        scan_spine::{self, ScanSpine},
    },
};

/// How many items there are, and the workgroups for them: `count[index]` and slot `slot` of `args`, which
/// `dispatch_args` made with [`scan_reduce::items_per_group`].
#[derive(Clone, Copy)]
pub struct Extent<'a> {
    pub count: &'a Buffer<u32>,
    pub index: u32,
    pub args: &'a Buffer<u32>,
    pub slot: u32,
}

/// Exclusive prefix sum of u32.
pub struct Scan {
    gather: bool,
    reduce: ScanReduce,
    spine: ScanSpine,
    apply: ScanApply,
}

/// What a scan reads and writes.
#[derive(Clone, Copy)]
pub struct ScanBuffers<'a> {
    pub values: &'a Buffer<u32>,
    /// Item i is `values[index[i]]`; `None` for a scan that was made without gather.
    pub index: Option<&'a Buffer<u32>>,
    /// Scratch, [`scan_reduce::block_sums_len`] elements.
    pub block_sums: &'a Buffer<u32>,
    /// By item, in the order of the items.
    pub offsets: &'a Buffer<u32>,
}

impl Scan {
    pub fn new(context: &Context, gather: bool) -> Result<Self, GpuError> {
        Ok(Scan {
            gather,
            reduce: ScanReduce::new(context, gather)?,
            spine: ScanSpine::new(context)?,
            apply: ScanApply::new(context, gather)?,
        })
    }

    /// The total goes to `extent.count[total_index]`, which is not `extent.index`.
    pub fn record(&self, recorder: &mut Recorder, buffers: &ScanBuffers<'_>, extent: Extent<'_>, total_index: u32) {
        let ScanBuffers { values, block_sums, offsets, .. } = *buffers;
        let index = buffers.index.unwrap_or(values);
        debug_assert_eq!(self.gather, buffers.index.is_some());
        let Extent { count, index: count_index, args, slot } = extent;
        self.reduce.record(
            recorder,
            &scan_reduce::Buffers { count, values, index, block_sums },
            &scan_reduce::Push { count_index },
            args,
            slot,
        );
        self.spine.record(
            recorder,
            &scan_spine::Buffers { count, block_sums },
            &scan_spine::Push { count_index, total_index },
        );
        self.apply.record(
            recorder,
            &scan_apply::Buffers { count, values, index, block_sums, offsets },
            &scan_apply::Push { count_index },
            args,
            slot,
        );
    }
}

/// Stable sort of (key, value) pairs, least significant digit first.
pub struct RadixSort {
    passes: u32,
    digit_bits: u32,
    compact: Option<(RadixUpsweep, RadixDownsweep)>,
    upsweep: RadixUpsweep,
    spine: RadixSpine,
    downsweep: RadixDownsweep,
}

/// Keys and the values that go with them.
#[derive(Clone, Copy)]
pub struct Pairs<'a> {
    pub keys: &'a Buffer<u32>,
    pub values: &'a Buffer<u32>,
}

/// Scratch of a radix sort.
#[derive(Clone, Copy)]
pub struct RadixScratch<'a> {
    /// [`radix_upsweep::block_counts_len`] elements for [`RadixSort::digit_bits`].
    pub block_counts: &'a Buffer<u32>,
    /// [`radix_upsweep::digit_totals_len`] elements.
    pub digit_totals: &'a Buffer<u32>,
}

impl RadixSort {
    /// Sorts keys below 2^`key_bits` (1 to 32). With `compact`, keys of `0xFFFFFFFF` are dropped and the value of a key
    /// is its index.
    pub fn new(context: &Context, key_bits: u32, compact: bool) -> Result<Self, GpuError> {
        let (passes, digit_bits) = passes_for(key_bits);
        let compact = if compact {
            Some((RadixUpsweep::new(context, digit_bits, true)?, RadixDownsweep::new(context, digit_bits, true)?))
        } else {
            None
        };
        Ok(RadixSort {
            passes,
            digit_bits,
            compact,
            upsweep: RadixUpsweep::new(context, digit_bits, false)?,
            spine: RadixSpine::new(context, digit_bits)?,
            downsweep: RadixDownsweep::new(context, digit_bits, false)?,
        })
    }

    /// Width of the digits.
    pub fn digit_bits(&self) -> u32 {
        self.digit_bits
    }

    /// Which of the two pairs of [`RadixSort::record`] the sorted ones end up in.
    pub fn last_pair(&self) -> usize {
        (self.passes as usize + 1) % 2
    }

    /// Pass p writes `pairs[p % 2]`; the sorted pairs, which are returned, are in the last one written. `input` may be
    /// `pairs[1]` if it is not needed any more. A compacting sort does not read `input.values`, and leaves the number of
    /// pairs at `extent.count[kept_index]`, which is not `extent.index`; any other sort takes no notice of `kept_index`.
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
        let Extent { count, index, args, slot } = extent;
        let (mut count_index, mut from) = (index, input);
        for pass in 0..self.passes {
            let shift = pass * self.digit_bits;
            let to = pairs[pass as usize % 2];
            let (upsweep, downsweep) = match (&self.compact, pass) {
                (Some((upsweep, downsweep)), 0) => (upsweep, downsweep),
                _ => (&self.upsweep, &self.downsweep),
            };
            let buffers = radix_upsweep::Buffers { count, keys_in: from.keys, block_counts };
            upsweep.record(recorder, &buffers, &radix_upsweep::Push { count_index, shift }, args, slot);
            let buffers = radix_spine::Buffers { count, block_counts, digit_totals };
            self.spine.record(recorder, &buffers, &radix_spine::Push { count_index });
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
            downsweep.record(recorder, &buffers, &push, args, slot);
            // The dropped keys are at the end of the dispatch from here on: workgroups beyond the count have nothing to do.
            if self.compact.is_some() {
                count_index = kept_index;
            }
            from = to;
        }
        from
    }
}

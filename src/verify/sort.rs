//! Verifies scan and radix sort, with every digit width that sorting uses.

use super::Bench;
use crate::{
    error::Result,
    gpu::{Buffer, Context, GpuError, Recorder},
    pipelines::sort::{Extent, Input, Pairs, RadixScratch, RadixSort, Scan, ScanBuffers},
    reference::radix_upsweep::NO_KEY,
    stages::{
        blocks::{DIGIT_TOTALS, block_counts_len, block_sums_len, items_per_group},
        dispatch_args,
        status::{self, Resource},
    },
};

/// Widths of keys: 32 bits for depths (four digits of 8), the others for tile numbers of small and large
/// images (digits of 1, 3, 8, twice 6 and twice 7).
const KEY_BITS: [u32; 6] = [32, 1, 3, 8, 12, 13];

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    // One item less than a multiple of blocks and workgroups.
    let items: u32 = if quick { 30_719 } else { (1 << 20) - 1 };
    for gather in [false, true] {
        scan(bench, items, gather)?;
    }
    for key_bits in KEY_BITS {
        for input in [Input::Keys, Input::Some, Input::All] {
            radix(bench, items, key_bits, input)?;
        }
    }
    Ok(())
}

/// A small case of several workgroups, the last one partial.
pub(super) fn check(bench: &Bench<'_>) -> Result<()> {
    let items = 20_479;
    scan(bench, items, false)?;
    radix(bench, items, 12, Input::Keys)
}

/// A number for each i, without a pattern.
pub fn noise(i: u32) -> u32 {
    let x = (i ^ i >> 16).wrapping_mul(0x7feb_352d);
    (x ^ x >> 15).wrapping_mul(0x846c_a68b)
}

/// Resource to report if a count is too large.
pub const RESOURCE: Resource = Resource::Intersections;
/// Word of a count's buffer for the number of items.
pub const ITEMS: u32 = 0;
/// Word of a count's buffer for the result of a sort or scan.
pub const RESULT: u32 = 1;

/// A number of items on the device, with its dispatch, the second of two.
pub struct Counted {
    /// Number of items, and 12345 until there is a result.
    pub count: Buffer<u32>,
    /// Dispatches.
    pub args: Buffer<u32>,
    /// See `stages::status`.
    pub status: Buffer<u32>,
    /// Stage that limits the items and computes the dispatch.
    pub stage: dispatch_args::Stage,
}

impl Counted {
    /// Uploads the number.
    pub fn new(context: &Context, items: u32) -> Result<Self, GpuError> {
        Ok(Counted {
            count: Buffer::from_slice(context, "count", &[items, 12345])?,
            args: Buffer::zeroed(context, "args", 6)?,
            status: Buffer::zeroed(context, "status", status::WORDS)?,
            stage: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 })?,
        })
    }

    /// Limits the items to `capacity`.
    pub fn record(&self, recorder: &mut Recorder, capacity: u32, items_per_group: u32) {
        let buffers = dispatch_args::Buffers { count: &self.count, dispatch_args: &self.args, status: &self.status };
        let resource_index = RESOURCE.index();
        let push = dispatch_args::Push { count_index: ITEMS, capacity, items_per_group, args_index: 3, resource_index };
        self.stage.record(recorder, &buffers, &push, 1);
    }

    /// The items as input of a sort or scan.
    pub fn extent(&self) -> Extent<'_> {
        Extent { count: &self.count, index: ITEMS, args: &self.args, dispatch: 1 }
    }
}

fn scan(bench: &Bench<'_>, items: u32, gather: bool) -> Result<()> {
    let context = &bench.shadowed;
    let counted = Counted::new(context, items)?;
    // The total exceeds 2^32 in the last part, so a scan must saturate.
    let values: Vec<u32> = (0..items).map(|i| noise(i) % (u32::MAX / items * 5 / 2)).collect();
    let index: Vec<u32> = (0..items).map(|i| noise(i + 9) % items).collect();
    let values = Buffer::from_slice(context, "values", &values)?;
    let index = Buffer::from_slice(context, "index", &index)?;
    let block_sums = Buffer::zeroed(context, "block sums", block_sums_len(items))?;
    let offsets = Buffer::zeroed(context, "offsets", items as usize)?;
    let stage = Scan::new(context, gather)?;
    bench.run(|recorder| {
        counted.record(recorder, items, items_per_group(context.info()));
        let index = gather.then_some(&index);
        let buffers = ScanBuffers { values: &values, index, block_sums: &block_sums, offsets: &offsets };
        stage.record(recorder, &buffers, counted.extent(), RESULT);
    })?;
    // More items than fit.
    bench.run(|recorder| counted.record(recorder, items / 3, items_per_group(context.info())))
}

fn radix(bench: &Bench<'_>, items: u32, key_bits: u32, input_is: Input) -> Result<()> {
    let context = &bench.shadowed;
    // In a compacting sort every third has no key.
    let compact = input_is != Input::All;
    let key = |i: u32| if compact && noise(i).is_multiple_of(3) { NO_KEY } else { noise(i + 5) >> (32 - key_bits) };
    let keys: Vec<u32> = (0..items).map(key).collect();
    let values: Vec<u32> = (0..items).map(|i| noise(i + 77)).collect();
    let counted = Counted::new(context, items)?;
    let n = items as usize;
    let input = (Buffer::from_slice(context, "keys", &keys)?, Buffer::from_slice(context, "values", &values)?);
    let buffer = |name: &str, len: usize| Buffer::zeroed(context, name, len);
    let (a, b) = ((buffer("keys a", n)?, buffer("values a", n)?), (buffer("keys b", n)?, buffer("values b", n)?));
    let stage = RadixSort::new(context, key_bits, input_is)?;
    let block_counts = buffer("block counts", block_counts_len(items, key_bits))?;
    let digit_totals = buffer("digit totals", DIGIT_TOTALS)?;
    let pairs = [&a, &b].map(|p| Pairs { keys: &p.0, values: &p.1 });
    bench.run(|recorder| {
        counted.record(recorder, items, items_per_group(context.info()));
        let scratch = RadixScratch { block_counts: &block_counts, digit_totals: &digit_totals };
        let from = Pairs { keys: &input.0, values: &input.1 };
        stage.record(recorder, from, pairs, scratch, counted.extent(), RESULT);
    })
}

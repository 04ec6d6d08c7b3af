//! Scan and radix sort, of every digit width that sorting chooses from.

use super::Bench;
use crate::{
    error::Result,
    gpu::{Buffer, Recorder},
    pipelines::sort::{Extent, Input, Pairs, RadixScratch, RadixSort, Scan, ScanBuffers},
    reference,
    stages::{
        blocks::{Blocks, DIGIT_TOTALS, block_counts_len, block_sums_len, items_per_group},
        dispatch_args,
        status::{self, Resource, Status},
    },
    verify::judge::Work,
};

/// Widths of keys: 32 bits are depths (four digits of 8), the others the tile numbers of small and large images (digits of 1,
/// 3, 8, twice 6 and twice 7).
const KEY_BITS: [u32; 6] = [32, 1, 3, 8, 12, 13];
/// What stands for no key in a compacting pass.
use reference::radix_upsweep::NO_KEY;

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    // One item less than whole blocks and workgroups.
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

/// Of several workgroups, the last not full.
pub(super) fn check(bench: &mut Bench<'_>) -> Result<()> {
    let items = 20_479;
    scan(bench, items, false)?;
    radix(bench, items, 12, Input::Keys)
}

pub(super) fn noise(i: u32) -> u32 {
    let x = (i ^ i >> 16).wrapping_mul(0x7feb_352d);
    (x ^ x >> 15).wrapping_mul(0x846c_a68b)
}

/// What a count that is too large is told as.
const RESOURCE: Resource = Resource::Intersections;
/// Words of the count buffer.
const ITEMS: u32 = 0;
const RESULT: u32 = 1;

/// A number of items on the device and the workgroups for it.
struct Counted {
    count: Buffer<u32>,
    args: Buffer<u32>,
    status: Buffer<u32>,
    stage: dispatch_args::Stage,
    items: u32,
    per_group: u32,
}

impl Counted {
    fn new(bench: &Bench<'_>, items: u32) -> Result<Self> {
        let context = bench.context;
        Ok(Counted {
            count: Buffer::from_slice(context, "count", &[items, 0])?,
            args: Buffer::zeroed(context, "args", 3)?,
            status: Buffer::zeroed(context, "status", status::WORDS)?,
            stage: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 })?,
            items,
            per_group: items_per_group(context.info()),
        })
    }

    fn record(&self, recorder: &mut Recorder) {
        self.record_within(recorder, self.items);
    }

    fn record_within(&self, recorder: &mut Recorder, capacity: u32) {
        let buffers = dispatch_args::Buffers { count: &self.count, dispatch_args: &self.args, status: &self.status };
        let push = dispatch_args::Push {
            count_index: ITEMS,
            capacity,
            items_per_group: self.per_group,
            args_index: 0,
            resource_index: RESOURCE.index(),
        };
        self.stage.record(recorder, &buffers, &push, 1);
    }

    fn extent(&self) -> Extent<'_> {
        Extent { count: &self.count, index: ITEMS, args: &self.args, dispatch: 0 }
    }
}

fn scan(bench: &mut Bench<'_>, items: u32, gather: bool) -> Result<()> {
    let context = bench.context;
    let counted = Counted::new(bench, items)?;
    // The sum passes 2^32, where a scan stays at the largest number, in its last part.
    let values: Vec<u32> = (0..items).map(|i| noise(i) % (u32::MAX / items * 5 / 2)).collect();
    let index: Vec<u32> = (0..items).map(|i| noise(i + 9) % items).collect();
    let values_there = Buffer::from_slice(context, "values", &values)?;
    let index_there = Buffer::from_slice(context, "index", &index)?;
    let block_sums = Buffer::zeroed(context, "block sums", block_sums_len(items))?;
    let offsets = Buffer::zeroed(context, "offsets", items as usize)?;
    let stage = Scan::new(context, gather)?;
    let times = bench.time(|recorder| {
        counted.record(recorder);
        let index = gather.then_some(&index_there);
        let buffers = ScanBuffers { values: &values_there, index, block_sums: &block_sums, offsets: &offsets };
        stage.record(recorder, &buffers, counted.extent(), RESULT);
    })?;

    if !gather {
        let mut row = bench.row("dispatch_args", "");
        // The first fits.
        for capacity in [items, items / 3] {
            let mut recorder = context.recorder("dispatch args")?;
            counted.record_within(&mut recorder, capacity);
            recorder.submit()?.wait()?;
            let (count, needed, groups) = reference::dispatch_args::dispatch_args(items, capacity, counted.per_group);
            row.words(&counted.args.download()?, &groups);
            row.words(&counted.count.download_range(0, 1)?, &[count]);
            let mut told = Status::default();
            told.ask(RESOURCE, items);
            needed.into_iter().for_each(|needed| told.fail(RESOURCE, needed));
            row.words(&counted.status.download()?, &told.0);
        }
        row.work.bytes = 16.0;
        row.time = times.of("dispatch_args");
        bench.push(row);
    }
    let index = gather.then_some(&index[..]);
    let block = Blocks::of(context.info()).block as usize;
    let reduced = reference::scan_reduce::scan_reduce(&values, index, block);
    let sums = reference::scan_spine::scan_spine(&reduced);
    let want = reference::scan_apply::scan_apply(&values, index, &sums, block);
    let variant = format!("{items} items{}", if gather { ", gathered" } else { "" });
    let (n, blocks) = (f64::from(items), sums.len() as f64);
    let read = if gather { 8.0 } else { 4.0 } * n;
    let got_sums = block_sums.download()?;
    // The block sums are scanned in place: that they are right says that both kernels are.
    for (stage, bytes) in [("scan_reduce", read + 4.0 * blocks), ("scan_spine", 8.0 * blocks)] {
        let mut row = bench.row(stage, &variant);
        row.words(&got_sums[..sums.len()], &sums);
        row.work.bytes = bytes;
        row.time = times.of(stage);
        bench.push(row);
    }
    let mut row = bench.row("scan_apply", variant);
    row.words(&offsets.download()?, &want);
    row.words(&counted.count.download_range(1, 1)?, &sums[sums.len() - 1..]);
    row.work.bytes = read + 4.0 * (n + blocks);
    row.time = times.of("scan_apply");
    bench.push(row);
    Ok(())
}

fn radix(bench: &mut Bench<'_>, items: u32, key_bits: u32, input_is: Input) -> Result<()> {
    let context = bench.context;
    let (passes, bits) = Blocks::of(context.info()).passes_for(key_bits);
    let (compact, indexed) = (input_is != Input::All, input_is == Input::Keys);
    // Every third has no key in a compacting sort.
    let key = |i: u32| if compact && noise(i).is_multiple_of(3) { NO_KEY } else { noise(i + 5) >> (32 - key_bits) };
    let keys: Vec<u32> = (0..items).map(key).collect();
    let values: Vec<u32> = (0..items).map(|i| noise(i + 77)).collect();
    let counted = Counted::new(bench, items)?;
    let n = items as usize;
    let input = (Buffer::from_slice(context, "keys", &keys)?, Buffer::from_slice(context, "values", &values)?);
    let buffer = |name: &str, len: usize| Buffer::zeroed(context, name, len);
    let (a, b) = ((buffer("keys a", n)?, buffer("values a", n)?), (buffer("keys b", n)?, buffer("values b", n)?));
    let stage = RadixSort::new(context, key_bits, input_is)?;
    let block_counts = buffer("block counts", block_counts_len(items, key_bits))?;
    let digit_totals = buffer("digit totals", DIGIT_TOTALS)?;
    let pairs = [&a, &b].map(|p| Pairs { keys: &p.0, values: &p.1 });
    let times = bench.time(|recorder| {
        counted.record(recorder);
        let scratch = RadixScratch { block_counts: &block_counts, digit_totals: &digit_totals };
        let from = Pairs { keys: &input.0, values: &input.1 };
        stage.record(recorder, from, pairs, scratch, counted.extent(), RESULT);
    })?;

    let (mut keys_now, mut values_now) = (keys, (!indexed).then_some(values));
    let mut last = (vec![], vec![]);
    for pass in 0..passes {
        let (shift, block) = (pass * bits, Blocks::of(context.info()).block as usize);
        let drops = compact && pass == 0;
        let counts = reference::radix_upsweep::radix_upsweep(&keys_now, shift, bits, drops, block);
        last = reference::radix_spine::radix_spine(&counts, bits);
        let (keys, values) = reference::radix_downsweep::radix_downsweep(
            (&keys_now, values_now.as_deref()),
            drops,
            &last.0,
            &last.1,
            shift,
            bits,
            block,
        );
        (keys_now, values_now) = (keys, Some(values));
    }
    let kept = keys_now.len();
    let what = match input_is {
        Input::All => "",
        Input::Some => ", compacting pairs",
        Input::Keys => ", compacting",
    };
    let variant = format!("{passes}×{bits} bits{what}");
    let (counters, totals) = (block_counts.download()?, digit_totals.download()?);
    let counter_bytes = 4.0 * last.0.len() as f64;
    // Of a compacting sort the first pass reads all keys, and no values where they are indices, later ones only what was kept.
    let per_pass = |first: f64, later: f64| (first + later * f64::from(passes - 1)) / f64::from(passes);
    let (all, kept_bytes) = (4.0 * n as f64, 4.0 * kept as f64);
    let down_first = all * if indexed { 1.0 } else { 2.0 } + 2.0 * kept_bytes;
    let rows = [
        ("radix_upsweep", per_pass(all, kept_bytes) + counter_bytes),
        ("radix_spine", 2.0 * counter_bytes),
        ("radix_downsweep", per_pass(down_first, 4.0 * kept_bytes) + counter_bytes),
    ];
    let sorted = pairs[stage.last_pair()];
    for (name, bytes) in rows {
        let mut row = bench.row(name, &variant);
        // The engine sorts depths and tiles with compaction, and by whatever width the image's tiles need.
        row.chosen = compact;
        if name == "radix_downsweep" {
            row.words(&sorted.keys.download_range(0, kept)?, &keys_now);
            row.words(&sorted.values.download_range(0, kept)?, values_now.as_deref().unwrap_or(&[]));
        } else {
            // Scanned in place over the blocks: right only if both kernels are.
            row.words(&counters[..last.0.len().min(counters.len())], &last.0);
            row.words(&totals[..last.1.len()], &last.1);
        }
        row.work = Work { bytes, operations: 0.0 };
        row.time = times.of(name);
        bench.push(row);
    }
    Ok(())
}

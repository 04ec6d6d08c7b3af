//! Compares scan and radix sort on the GPU with their twins. All are integers, so results must be equal.

mod common;

use common::{Gpu, assert_no_breach};
use glint::{
    gpu::{Buffer, Context},
    pipelines::sort::{Input, Pairs, RadixScratch, RadixSort, Scan, ScanBuffers},
    reference,
    stages::{
        blocks::{DIGIT_TOTALS, block_counts_len, block_sums_len, items_per_group},
        constants::status::NO_RESOURCE,
        dispatch_args,
        status::Status,
    },
    verify::sort::{Counted, ITEMS, RESOURCE, RESULT, noise},
};

const NO_KEY: u32 = u32::MAX;
/// Nothing, one, a row less one, a block and its neighbours, several workgroups with a partial block at the
/// end.
const SIZES: [u32; 8] = [0, 1, 7, 1023, 1024, 1025, 8 * 1024 + 1, 30_000];

fn upload(context: &Context, name: &str, data: &[u32]) -> Buffer<u32> {
    Buffer::from_slice(context, name, data).unwrap()
}

/// Records a dispatch over `items` counts; returns the first dispatch.
fn dispatched(context: &Context, counted: &Counted, items: u32, items_per_group: u32, resource_index: u32) -> Vec<u32> {
    let buffers =
        dispatch_args::Buffers { count: &counted.count, dispatch_args: &counted.args, status: &counted.status };
    let push = dispatch_args::Push { count_index: ITEMS, capacity: 9, items_per_group, args_index: 0, resource_index };
    let mut recorder = context.recorder("args").unwrap();
    counted.stage.record(&mut recorder, &buffers, &push, items);
    recorder.submit().unwrap().wait().unwrap();
    counted.args.download_range(0, 3).unwrap()
}

#[test]
fn a_stage_over_no_items_is_not_recorded() {
    let context = Gpu::new();
    let counted = Counted::new(&context, 9).unwrap();
    for (items, wanted) in [(0, [0; 3]), (1, [9, 1, 1])] {
        assert_eq!(dispatched(&context, &counted, items, 1, RESOURCE.index()), wanted);
    }
}

#[test]
fn nothing_is_told_of_what_always_fits() {
    let context = Gpu::new();
    let counted = Counted::new(&context, 9).unwrap();
    for (resource_index, asked) in [(NO_RESOURCE, None), (RESOURCE.index(), Some(9))] {
        assert_eq!(dispatched(&context, &counted, 1, 2, resource_index), [5, 1, 1]);
        let mut want = Status::default();
        asked.into_iter().for_each(|asked| want.ask(RESOURCE, asked));
        assert_eq!(counted.status.download().unwrap(), want.0);
    }
}

fn scan(context: &Context, values: &[u32], index: Option<&[u32]>) -> (Vec<u32>, u32) {
    let items = index.map_or(values.len(), <[u32]>::len) as u32;
    let counted = Counted::new(context, items).unwrap();
    let values = upload(context, "values", values);
    let index = index.map(|index| upload(context, "index", index));
    let block_sums = Buffer::zeroed(context, "block_sums", block_sums_len(items)).unwrap();
    let offsets = Buffer::zeroed(context, "offsets", items as usize).unwrap();
    let scan = Scan::new(context, index.is_some()).unwrap();
    let mut recorder = context.recorder("scan").unwrap();
    counted.record(&mut recorder, items, items_per_group(context.info()));
    let buffers = ScanBuffers { values: &values, index: index.as_ref(), block_sums: &block_sums, offsets: &offsets };
    scan.record(&mut recorder, &buffers, counted.extent(), RESULT);
    recorder.submit().unwrap().wait().unwrap();
    (offsets.download_range(0, items as usize).unwrap(), counted.count.download().unwrap()[1])
}

/// Compares a scan with a loop, and its stages with their twins.
fn check_scan(context: &Context, values: &[u32], index: Option<&[u32]>) {
    let count = index.map_or(values.len(), <[u32]>::len);
    let value = |n: usize| index.map_or(values[n], |index| values[index[n] as usize]);
    let sums: Vec<u32> = (0..count)
        .scan(0u32, |sum, n| {
            *sum = sum.saturating_add(value(n));
            Some(*sum)
        })
        .collect();
    let total = sums.last().copied().unwrap_or(0);
    let offsets: Vec<u32> = std::iter::once(0).chain(sums).take(count).collect();
    assert_no_breach(context, |context| {
        assert!(scan(context, values, index) == (offsets.clone(), total), "{} values", values.len());
    });
}

#[test]
fn a_scan_is_its_twin_at_every_size() {
    let context = Gpu::new();
    for items in SIZES.into_iter().chain([300_000]) {
        check_scan(&context, &(0..items).map(|i| noise(i) % 100).collect::<Vec<_>>(), None);
    }
}

#[test]
fn a_gathering_scan_sums_in_the_order_of_the_index() {
    let context = Gpu::new();
    let values: Vec<u32> = (0..5000).map(|i| noise(i) % 1000).collect();
    let index: Vec<u32> = (0..3000).map(|i| noise(i + 9) % 5000).collect();
    check_scan(&context, &values, Some(&index));
}

#[test]
fn a_scan_stops_at_the_largest_number() {
    let context = Gpu::new();
    let mut values: Vec<u32> = (0..5000).map(|i| noise(i) % 1000).collect();
    values[2500] = u32::MAX - 800_000;
    check_scan(&context, &values, None);
    values[0] = u32::MAX;
    values[1] = u32::MAX;
    check_scan(&context, &values, None);
    check_scan(&context, &[u32::MAX; 3000], None);
}

#[test]
fn a_dispatch_is_its_twin_and_reports_what_did_not_fit() {
    let context = Gpu::new();
    let cases = [(0, 10, 64), (1, 10, 64), (1000, 1000, 64), (1001, 1000, 64), (u32::MAX, 1 << 26, 1), (9, 9, 0)];
    for (items, capacity, per_group) in cases {
        let counted = Counted::new(&context, items).unwrap();
        let mut recorder = context.recorder("dispatch_args").unwrap();
        counted.record(&mut recorder, capacity, per_group);
        // A second time, with the clamped number: the required number stays.
        counted.record(&mut recorder, capacity, per_group);
        recorder.submit().unwrap().wait().unwrap();
        let (count, overflow, groups) = reference::dispatch_args::dispatch_args(items, capacity, per_group);
        assert_eq!(counted.count.download().unwrap(), [count, 12345]);
        let mut told = Status::default();
        told.ask(RESOURCE, items);
        overflow.into_iter().for_each(|needed| told.fail(RESOURCE, needed));
        assert_eq!(counted.status.download().unwrap(), told.0);
        assert_eq!(counted.args.download().unwrap()[3..], groups);
    }
}

fn pairs(context: &Context, name: &str, len: usize) -> (Buffer<u32>, Buffer<u32>) {
    (Buffer::zeroed(context, name, len).unwrap(), Buffer::zeroed(context, name, len).unwrap())
}

/// Sorts on the GPU; `None` for the values: the value of a key is its index. Returns keys and values.
fn sort(context: &Context, keys: &[u32], values: Option<&[u32]>, drops: bool, key_bits: u32) -> [Vec<u32>; 2] {
    let items = keys.len() as u32;
    let counted = Counted::new(context, items).unwrap();
    let input = upload(context, "keys", keys);
    let input_values = values.map(|values| upload(context, "values", values));
    let input_is = match (values, drops) {
        (None, _) => Input::Keys,
        (_, true) => Input::Some,
        (_, false) => Input::All,
    };
    let radix = RadixSort::new(context, key_bits, input_is).unwrap();
    let (a, b) = (pairs(context, "a", keys.len()), pairs(context, "b", keys.len()));
    let block_counts = Buffer::zeroed(context, "block_counts", block_counts_len(items, key_bits)).unwrap();
    let digit_totals = Buffer::zeroed(context, "digit_totals", DIGIT_TOTALS).unwrap();
    let mut recorder = context.recorder("sort").unwrap();
    counted.record(&mut recorder, items, items_per_group(context.info()));
    let sorted = radix.record(
        &mut recorder,
        Pairs { keys: &input, values: input_values.as_ref().unwrap_or(&input) },
        [Pairs { keys: &a.0, values: &a.1 }, Pairs { keys: &b.0, values: &b.1 }],
        RadixScratch { block_counts: &block_counts, digit_totals: &digit_totals },
        counted.extent(),
        RESULT,
    );
    recorder.submit().unwrap().wait().unwrap();
    let kept = if drops { counted.count.download().unwrap()[1] as usize } else { keys.len() };
    assert_eq!(input.download_range(0, keys.len()).unwrap(), keys, "the input is kept");
    [sorted.keys.download_range(0, kept).unwrap(), sorted.values.download_range(0, kept).unwrap()]
}

/// Compares a sort with the standard library's, and its stages with their twins.
fn check_sort(context: &Context, keys: &[u32], values: Option<&[u32]>, drops: bool, key_bits: u32) {
    let mut expected: Vec<(u32, u32)> = (0..keys.len())
        .filter(|&i| !drops || keys[i] != NO_KEY)
        .map(|i| (keys[i], values.map_or(i as u32, |values| values[i])))
        .collect();
    expected.sort_by_key(|pair| pair.0);
    assert_no_breach(context, |context| {
        let [keys_out, values_out] = sort(context, keys, values, drops, key_bits);
        let what = format!("{} keys by {key_bits} bits, values {}", keys.len(), values.is_some());
        assert!(expected.iter().copied().eq(keys_out.into_iter().zip(values_out)), "{what}");
    });
}

#[test]
fn a_sort_is_its_twin_at_every_size() {
    let context = Gpu::new();
    for items in SIZES {
        let keys: Vec<u32> = (0..items).map(noise).collect();
        let values: Vec<u32> = (0..items).map(|i| noise(i + 77)).collect();
        check_sort(&context, &keys, Some(&values), false, 32);
    }
}

#[test]
fn a_sort_is_stable_whatever_the_width_of_the_keys() {
    let context = Gpu::new();
    let values: Vec<u32> = (0..9000).collect();
    for key_bits in [1, 3, 8, 10, 12, 13, 31] {
        let keys: Vec<u32> = (0..9000).map(|i| noise(i) >> (32 - key_bits)).collect();
        check_sort(&context, &keys, Some(&values), false, key_bits);
    }
    check_sort(&context, &[5; 3000], Some(&values[..3000]), false, 8);
}

#[test]
fn a_compacting_sort_drops_what_has_no_key() {
    let context = Gpu::new();
    for items in SIZES {
        let keys: Vec<u32> = (0..items)
            .map(|i| if noise(i).is_multiple_of(3) { NO_KEY } else { (0.2 + i as f32 % 77.7).to_bits() })
            .collect();
        let values: Vec<u32> = (0..items).map(|i| noise(i + 77)).collect();
        check_sort(&context, &keys, None, true, 32);
        check_sort(&context, &keys, Some(&values), true, 32);
    }
    check_sort(&context, &[NO_KEY; 5000], None, true, 32);
}

//! Twin of `scan_apply.comp`: the start of each item in a prefix sum.

use super::scan_reduce::items;

/// Start of each item, given the start of its block of `block` items; at most `u32::MAX`. With `index`, item
/// i is `values[index[i]]`.
pub fn scan_apply(values: &[u32], index: Option<&[u32]>, block_sums: &[u32], block: usize) -> Vec<u32> {
    let items = items(values, index);
    let mut offsets = Vec::with_capacity(items.len());
    for (values, &begin) in items.chunks(block).zip(block_sums) {
        let mut before = begin;
        for &value in values {
            offsets.push(before);
            before = before.saturating_add(value);
        }
    }
    offsets
}

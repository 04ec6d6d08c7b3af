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

#[cfg(test)]
mod tests {
    use super::super::{scan_reduce::scan_reduce, scan_spine::scan_spine};
    use super::*;

    fn scan(values: &[u32], index: Option<&[u32]>, block: usize) -> (Vec<u32>, u32) {
        let begins = scan_spine(&scan_reduce(values, index, block));
        (scan_apply(values, index, &begins, block), *begins.last().unwrap())
    }

    #[test]
    fn three_kernels_make_one_exclusive_sum_whatever_the_block() {
        let values: Vec<u32> = (0..1000u32).map(|i| i * 7919 % 31).collect();
        let expected: Vec<u32> = (0..1000).map(|i| values[..i].iter().sum()).collect();
        let sum = values.iter().sum();
        for block in [1, 8, 999, 1000, 1024] {
            assert_eq!(scan(&values, None, block), (expected.clone(), sum));
        }
    }

    #[test]
    fn no_values_sum_to_nothing() {
        assert_eq!(scan(&[], None, 8), (vec![], 0));
    }

    #[test]
    fn a_gather_scans_in_the_order_of_the_index() {
        assert_eq!(scan(&[5, 7, 11], Some(&[2, 0]), 8), (vec![0, 11], 16));
    }

    #[test]
    fn sums_stop_at_the_largest_number() {
        assert_eq!(scan(&[3, u32::MAX - 1, 4, 5], None, 2).0, [0, 3, u32::MAX, u32::MAX]);
    }
}

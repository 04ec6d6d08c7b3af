//! Twin of `scan_reduce.comp`: sums of blocks.

/// The sum of each block of `block` values, at most `u32::MAX`. With `index`, item i is `values[index[i]]`.
pub fn scan_reduce(values: &[u32], index: Option<&[u32]>, block: usize) -> Vec<u32> {
    items(values, index).chunks(block).map(|block| block.iter().fold(0, |sum: u32, &v| sum.saturating_add(v))).collect()
}

/// The scanned values, in their order.
pub(super) fn items(values: &[u32], index: Option<&[u32]>) -> Vec<u32> {
    match index {
        Some(index) => index.iter().map(|&i| values[i as usize]).collect(),
        None => values.to_vec(),
    }
}

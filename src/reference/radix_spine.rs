//! Twin of `radix_spine.comp`: prefix sums of the blocks' digit counts.

/// For each block and digit, the number of keys with the digit in earlier blocks; and the total of each
/// digit.
pub fn radix_spine(block_counts: &[u32], bits: u32) -> (Vec<u32>, Vec<u32>) {
    let mut totals = vec![0; 1 << bits];
    let mut before = Vec::with_capacity(block_counts.len());
    for counts in block_counts.chunks(1 << bits) {
        for (total, count) in totals.iter_mut().zip(counts) {
            before.push(*total);
            *total += count;
        }
    }
    (before, totals)
}

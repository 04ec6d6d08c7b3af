//! Twin of `scan_spine.comp`: the start of each block in a prefix sum.

/// Start of each block, followed by the total, at most `u32::MAX`: blocks + 1 values.
pub fn scan_spine(block_sums: &[u32]) -> Vec<u32> {
    let mut before = 0u32;
    let mut offsets = vec![0];
    for &sum in block_sums {
        before = before.saturating_add(sum);
        offsets.push(before);
    }
    offsets
}

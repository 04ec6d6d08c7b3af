//! Twin of `radix_upsweep.comp`: counts each digit in each block.

/// Marks a missing key in a compacting pass.
pub const NO_KEY: u32 = u32::MAX;

/// The digit of `bits` bits from bit `shift` on.
pub fn digit_of(key: u32, shift: u32, bits: u32) -> usize {
    (key >> shift & ((1 << bits) - 1)) as usize
}

/// Counts each digit in each block of `block` keys: element `b << bits | digit`. With `compact`, keys of
/// [`NO_KEY`] are not counted.
pub fn radix_upsweep(keys: &[u32], shift: u32, bits: u32, compact: bool, block: usize) -> Vec<u32> {
    let mut counts = Vec::with_capacity(keys.len().div_ceil(block) << bits);
    for keys in keys.chunks(block) {
        let mut digit_counts = vec![0; 1 << bits];
        for &key in keys {
            if !compact || key != NO_KEY {
                digit_counts[digit_of(key, shift, bits)] += 1;
            }
        }
        counts.append(&mut digit_counts);
    }
    counts
}

//! Twin of `radix_downsweep.comp`: moves pairs to their places in a radix sort pass.

use super::radix_upsweep::{NO_KEY, digit_of};

/// One pass: returns the pairs in the order of their digit, pairs of equal digit in their old order. Without
/// values the value of a key is its index. With `compact`, keys of [`NO_KEY`] are dropped.
pub fn radix_downsweep(
    (keys, values): (&[u32], Option<&[u32]>),
    compact: bool,
    block_counts: &[u32],
    digit_totals: &[u32],
    shift: u32,
    bits: u32,
    block: usize,
) -> (Vec<u32>, Vec<u32>) {
    let mut smaller = 0;
    let mut begins = Vec::with_capacity(digit_totals.len());
    for total in digit_totals {
        begins.push(smaller);
        smaller += total;
    }
    let (mut keys_out, mut values_out) = (vec![0; smaller as usize], vec![0; smaller as usize]);
    for (b, block_keys) in keys.chunks(block).enumerate() {
        let before = &block_counts[b << bits..(b + 1) << bits];
        let mut next_place: Vec<u32> = begins.iter().zip(before).map(|(begin, before)| begin + before).collect();
        for (i, &key) in block_keys.iter().enumerate().map(|(i, key)| (b * block + i, key)) {
            if compact && key == NO_KEY {
                continue;
            }
            let place = &mut next_place[digit_of(key, shift, bits)];
            keys_out[*place as usize] = key;
            values_out[*place as usize] = values.map_or(i as u32, |values| values[i]);
            *place += 1;
        }
    }
    (keys_out, values_out)
}

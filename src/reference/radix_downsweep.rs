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

#[cfg(test)]
mod tests {
    use super::super::{radix_spine::radix_spine, radix_upsweep::radix_upsweep};
    use super::*;

    fn sort(keys: &[u32], values: Option<&[u32]>, drops: bool, bits: u32, block: usize) -> (Vec<u32>, Vec<u32>) {
        let mut pairs = (keys.to_vec(), values.map(<[u32]>::to_vec));
        for shift in (0..32).step_by(bits as usize) {
            let compact = shift == 0 && drops;
            let counts = radix_upsweep(&pairs.0, shift, bits, compact, block);
            let (before, totals) = radix_spine(&counts, bits);
            let (keys, values) =
                radix_downsweep((&pairs.0, pairs.1.as_deref()), compact, &before, &totals, shift, bits, block);
            pairs = (keys, Some(values));
        }
        (pairs.0, pairs.1.unwrap())
    }

    fn keys() -> Vec<u32> {
        (0..3000u32).map(|i| if i % 5 == 0 { NO_KEY } else { i.wrapping_mul(2_654_435_761) >> (i % 29) }).collect()
    }

    #[test]
    fn passes_make_a_stable_sort_whatever_the_digit_and_the_block() {
        let keys = keys();
        let values: Vec<u32> = (0..keys.len() as u32).rev().collect();
        let mut expected: Vec<(u32, u32)> = keys.iter().copied().zip(values.iter().copied()).collect();
        expected.sort_by_key(|pair| pair.0);
        let expected: (Vec<u32>, Vec<u32>) = expected.into_iter().unzip();
        for (bits, block) in [(1, 64), (4, 1024), (5, 1), (7, 100), (8, 1024), (8, 10_000)] {
            assert_eq!(sort(&keys, Some(&values), false, bits, block), expected);
        }
    }

    #[test]
    fn a_compacting_pass_drops_what_has_no_key() {
        let keys = keys();
        let mut expected: Vec<(u32, u32)> =
            keys.iter().copied().zip(0..).filter(|pair: &(u32, u32)| pair.0 != NO_KEY).collect();
        expected.sort_by_key(|pair| pair.0);
        let (kept, indices): (Vec<u32>, Vec<u32>) = expected.into_iter().unzip();
        assert_eq!(sort(&keys, None, true, 8, 1024), (kept.clone(), indices.clone()));
        let values: Vec<u32> = (0..keys.len() as u32).map(|i| 3 * i).collect();
        let tripled = indices.iter().map(|i| 3 * i).collect();
        assert_eq!(sort(&keys, Some(&values), true, 8, 1024), (kept, tripled));
        assert_eq!(sort(&[NO_KEY; 9], None, true, 8, 4), (vec![], vec![]));
    }
}

//! Orders Gaussians along a space-filling curve, so that neighbours in a file are neighbours in the scene.

use super::floaters;

/// Bits per axis.
const BITS: u32 = 21;

/// Indices along Hilbert's curve: successive Gaussians are neighbours in space, and a run of the curve is
/// compact.
pub(super) fn along_curve(means: &[[f32; 3]]) -> Vec<usize> {
    // Floaters use the nearest cell; otherwise all others would share one.
    let (middle, limit) = floaters::core(means);
    let bound = |pick: fn(f64, f64) -> f64, start: f64, side: f64| {
        let all = means.iter().map(|mean| mean.map(f64::from));
        let most = all.fold([start; 3], |most, mean| std::array::from_fn(|axis| pick(most[axis], mean[axis])));
        // The nearer of both.
        [0, 1, 2].map(|axis| middle[axis] + side * (side * (most[axis] - middle[axis])).min(limit))
    };
    let (low, high) = (bound(f64::min, f64::INFINITY, -1.0), bound(f64::max, f64::NEG_INFINITY, 1.0));
    let cell = |mean: [f32; 3], axis: usize| {
        let size = high[axis] - low[axis];
        let share = if size > 0.0 { ((f64::from(mean[axis]) - low[axis]) / size).clamp(0.0, 1.0) } else { 0.0 };
        (share * f64::from((1u32 << BITS) - 1)) as u64
    };
    let code = |mean: [f32; 3]| on_curve([0, 1, 2].map(|axis| cell(mean, axis)));
    let mut codes: Vec<(u64, usize)> = means.iter().map(|&mean| code(mean)).zip(0..).collect();
    codes.sort_unstable();
    codes.into_iter().map(|(_, i)| i).collect()
}

/// Position of a cell on the curve, by J. Skilling's transform ("Programming the Hilbert curve", 2004).
fn on_curve(mut cell: [u64; 3]) -> u64 {
    let bits = || (1..BITS).rev().map(|i| 1u64 << i);
    for bit in bits() {
        let below = bit - 1;
        for axis in 0..3 {
            if cell[axis] & bit != 0 {
                cell[0] ^= below;
            } else {
                let swap = (cell[0] ^ cell[axis]) & below;
                cell[0] ^= swap;
                cell[axis] ^= swap;
            }
        }
    }
    cell[1] ^= cell[0];
    cell[2] ^= cell[1];
    let turn = bits().filter(|bit| cell[2] & bit != 0).fold(0, |turn, bit| turn ^ (bit - 1));
    cell.into_iter().fold(0, |code, v| code << 1 | spread(v ^ turn))
}

/// Inserts two zeros after each of 21 bits.
fn spread(bits: u64) -> u64 {
    [
        (32, 0x1f_0000_0000_ffff),
        (16, 0x1f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ]
    .into_iter()
    .fold(bits, |bits, (shift, mask)| (bits | bits << shift) & mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread_in_their_order() {
        for bits in [0, 1, 0b101, 0x1f_ffff, 0x15_5555] {
            let slow: u64 = (0..BITS).map(|i| (bits >> i & 1) << (3 * i)).sum();
            assert_eq!(spread(bits), slow, "{bits:#x}");
        }
    }

    #[test]
    fn who_comes_next_is_a_neighbour() {
        let points: Vec<[f32; 3]> = (0..512).map(|i| [i % 8, i / 8 % 8, i / 64].map(|v| v as f32)).collect();
        let order = along_curve(&points);
        let mut once = order.clone();
        once.sort_unstable();
        assert_eq!(once, (0..512).collect::<Vec<_>>());
        for pair in order.windows(2) {
            let [a, b] = [points[pair[0]], points[pair[1]]];
            assert_eq!((0..3).map(|axis| (a[axis] - b[axis]).abs()).sum::<f32>(), 1.0, "{a:?} {b:?}");
        }
        assert_eq!(along_curve(&[[2.0; 3]; 3]), [0, 1, 2]);
        assert!(along_curve(&[]).is_empty());
    }
}

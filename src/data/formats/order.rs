//! Gaussians in the order of a curve that fills space, so that neighbours in a file are neighbours in the scene.

use crate::scene::Gaussians;

/// Of each axis: enough that a far outlier does not put all others into one cell.
const BITS: u32 = 21;

/// Indices by Morton code, as G. M. Morton has it ("A computer oriented geodetic data base", 1966): the bits of x, y and z in turn.
pub(super) fn morton(means: &[[f32; 3]]) -> Vec<usize> {
    let bound = |pick: fn(f32, f32) -> f32, start: f32| {
        means
            .iter()
            .fold([start; 3], |most, mean| std::array::from_fn(|axis| pick(most[axis], mean[axis])))
            .map(f64::from)
    };
    let (low, high) = (bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY));
    let cell = |mean: [f32; 3], axis: usize| {
        let size = high[axis] - low[axis];
        let share = if size > 0.0 { (f64::from(mean[axis]) - low[axis]) / size } else { 0.0 };
        (share * f64::from((1u32 << BITS) - 1)) as u64
    };
    let code = |mean: [f32; 3]| (0..3).map(|axis| spread(cell(mean, axis)) << axis).sum::<u64>();
    let mut codes: Vec<(u64, usize)> = means.iter().map(|&mean| code(mean)).zip(0..).collect();
    codes.sort_unstable();
    codes.into_iter().map(|(_, i)| i).collect()
}

/// Two zeros between any two of 21 bits.
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

/// The Gaussians of these indices.
pub(super) fn take(gaussians: &Gaussians, order: &[usize]) -> Gaussians {
    let k = gaussians.sh_coefficients();
    Gaussians {
        sh_degree: gaussians.sh_degree,
        means: order.iter().map(|&i| gaussians.means[i]).collect(),
        log_scales: order.iter().map(|&i| gaussians.log_scales[i]).collect(),
        quats: order.iter().map(|&i| gaussians.quats[i]).collect(),
        opacities: order.iter().map(|&i| gaussians.opacities[i]).collect(),
        sh: order.iter().flat_map(|&i| &gaussians.sh[i * k..(i + 1) * k]).copied().collect(),
    }
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
    fn the_eighths_of_a_cube_follow_one_another() {
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 1.0f32 } else { -1.0 });
        let means: Vec<[f32; 3]> = (0..8).rev().map(corner).collect();
        assert_eq!(morton(&means), [7, 6, 5, 4, 3, 2, 1, 0]);
        assert_eq!(morton(&[[2.0; 3]; 3]), [0, 1, 2]);
        assert!(morton(&[]).is_empty());
    }
}

//! Twin of `density_draw.comp`: draws the parents of children.

use super::hash::pcg4d;
use crate::stages::constants::density::HASH_DRAW;

/// A draw with replacement: each Gaussian's weight covers a range of the sum `total`.
#[derive(Debug, Clone, Copy)]
pub struct Draw {
    /// Sum of the weights drawn from.
    pub total: u32,
    /// The run's step; with `seed` it determines the draws.
    pub step: u32,
    /// See `step`.
    pub seed: u32,
}

/// Returns the parent of a child. `order` holds the start of each weight, or without `draw` the candidates in
/// their order.
pub fn density_draw(child: u32, order: &[u32], draw: Option<Draw>) -> u32 {
    let Some(Draw { total, step, seed }) = draw else { return order[child as usize] };
    let at = ((u64::from(pcg4d([child, step, HASH_DRAW, seed])[0]) * u64::from(total)) >> 32) as u32;
    order.partition_point(|&first| first <= at).saturating_sub(1) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_follow_the_weights_and_pass_over_those_without() {
        let weights = [0u32, 1 << 20, 0, 3 << 20, 0];
        let mut sum = 0;
        let firsts = weights.map(|w| {
            sum += w;
            sum - w
        });
        let draw = Draw { total: sum, step: 1, seed: 2 };
        let mut counts = [0; 5];
        (0..4000).for_each(|child| counts[density_draw(child, &firsts, Some(draw)) as usize] += 1);
        assert_eq!([counts[0], counts[2], counts[4]], [0; 3]);
        // Five deviations of √(4000 · 3/16).
        assert!((counts[3] - 3000i32).abs() < 137, "{counts:?}");
        assert_eq!(density_draw(2, &[7, 5, 3], None), 3);
    }
}

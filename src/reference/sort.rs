//! The two sorts, both stable and ascending.

use super::NONE;

/// Gaussian indices of the visible (finite) depths by ascending z, ties by index: `global_from_rank`.
pub fn sort_depth(depths: &[f64]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..depths.len() as u32).filter(|&i| depths[i as usize] < f64::INFINITY).collect();
    order.sort_by(|&a, &b| depths[a as usize].total_cmp(&depths[b as usize]));
    order
}

/// Intersections by tile, in each tile by slot, which is front to back: `isect_tiles` and `isect_slots`,
/// given the tile of each slot. Slots without a tile are dropped.
pub fn sort_isects(tile_of_slot: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut slots: Vec<u32> =
        (0..tile_of_slot.len() as u32).filter(|&slot| tile_of_slot[slot as usize] != NONE).collect();
    slots.sort_by_key(|&slot| tile_of_slot[slot as usize]);
    (slots.iter().map(|&slot| tile_of_slot[slot as usize]).collect(), slots)
}

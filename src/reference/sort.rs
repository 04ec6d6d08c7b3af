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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_go_by_index_and_the_invisible_stay_out() {
        assert_eq!(sort_depth(&[3.0, f64::INFINITY, 1.0, 3.0, 1.0, f64::NAN]), [2, 4, 0, 3]);
        assert_eq!(sort_isects(&[5, 2, NONE, 5, 2, 0]), (vec![0, 2, 2, 5, 5], vec![5, 1, 4, 0, 3]));
    }
}

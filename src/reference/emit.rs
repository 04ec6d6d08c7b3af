//! Twin of `emit.comp`: writes one intersection for each Gaussian and tile, slots in rank order, a Gaussian's
//! tiles row by row. `tile_counts` fixes a Gaussian's number of slots: tiles beyond them are dropped, slots
//! beyond its tiles get the tile [`NONE`].

use super::{
    NONE, Splat,
    tiles::{Tiling, for_each_tile},
};
use crate::stages::constants::slots::SLOTS_PER_BLOCK;

/// Result of [`emit`].
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Emitted {
    /// Tile of each slot: keys of the sort by tile.
    pub tile_of_slot: Vec<u32>,
    /// Gaussian index of each slot.
    pub global_from_slot: Vec<u32>,
    /// First of a Gaussian's `tile_counts` slots, by Gaussian index. 0 if it has none.
    pub first_slot: Vec<u32>,
}

/// Tile and slot of every intersection, splats in depth order, `tile_counts` slots for each.
pub fn emit(splats: &[Splat], tile_counts: &[u32], global_from_rank: &[u32], tiling: &Tiling) -> Emitted {
    let mut out = Emitted { first_slot: vec![0; splats.len()], ..Default::default() };
    for &global in global_from_rank {
        let first = out.tile_of_slot.len();
        out.first_slot[global as usize] = first as u32;
        for_each_tile(&splats[global as usize], tiling, |tile| out.tile_of_slot.push(tile));
        out.tile_of_slot.resize(first + tile_counts[global as usize] as usize, NONE);
        out.global_from_slot.resize(out.tile_of_slot.len(), global);
    }
    out
}

/// Records that slots `first..first + count`, at least one, belong to `rank`. Blocks start at 0; see
/// `glsl/shared/slots.glsl`.
pub fn claim(rank_blocks: &mut [[u32; 2]], rank: u32, first: u32, count: u32) {
    if !first.is_multiple_of(SLOTS_PER_BLOCK) {
        rank_blocks[(first / SLOTS_PER_BLOCK) as usize][1] |= 1 << (first % SLOTS_PER_BLOCK);
    }
    let blocks = first.div_ceil(SLOTS_PER_BLOCK) as usize..(first + count).div_ceil(SLOTS_PER_BLOCK) as usize;
    rank_blocks[blocks].iter_mut().for_each(|block| block[0] = rank);
}

/// Gaussian index of the first `slots` slots; [`NONE`] if a lookup leaves its list.
pub fn globals(rank_blocks: &[[u32; 2]], global_from_rank: &[u32], slots: usize) -> Vec<u32> {
    let global = |slot: u32| {
        let [rank, begins] = *rank_blocks.get((slot / SLOTS_PER_BLOCK) as usize)?;
        let upto = u32::MAX >> (SLOTS_PER_BLOCK - 1 - slot % SLOTS_PER_BLOCK);
        global_from_rank.get(rank.wrapping_add((begins & upto).count_ones()) as usize).copied()
    };
    (0..slots as u32).map(|slot| global(slot).unwrap_or(NONE)).collect()
}

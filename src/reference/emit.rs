//! Writes one intersection per Gaussian and tile: slots in rank order, a Gaussian's tiles row by row. A Gaussian has as many
//! slots as `tile_counts` says: tiles beyond them are left out, slots beyond its tiles get the tile [`NONE`].

use super::{
    NONE, Splat,
    tiles::{Tiling, for_each_tile},
};

/// What [`emit`] lists.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Emitted {
    /// Tile of each slot; the sort by tile takes them from here.
    pub tile_of_slot: Vec<u32>,
    /// Gaussian index of each slot.
    pub global_from_slot: Vec<u32>,
    /// First slot of each Gaussian, by Gaussian index; it has `tile_counts` of them. 0 when it has none.
    pub first_slot: Vec<u32>,
}

/// Tile and slot of every intersection, splats in depth order; as many for each as `tile_counts` says.
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

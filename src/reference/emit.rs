//! Writes one intersection per Gaussian and tile: slots in rank order, a Gaussian's tiles row by row.

use super::Splat;
use super::tiles::{Tiling, for_each_tile};

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Emitted {
    /// Tile of each slot; the sort by tile takes them from here.
    pub tile_of_slot: Vec<u32>,
    /// Gaussian index of each slot.
    pub global_from_slot: Vec<u32>,
    /// First slot of each Gaussian, by Gaussian index; it has `tile_counts` of them. 0 when it has none.
    pub first_slot: Vec<u32>,
}

pub fn emit(splats: &[Splat], global_from_rank: &[u32], tiling: &Tiling) -> Emitted {
    let mut out = Emitted { first_slot: vec![0; splats.len()], ..Default::default() };
    for &global in global_from_rank {
        out.first_slot[global as usize] = out.tile_of_slot.len() as u32;
        for_each_tile(&splats[global as usize], tiling, |tile| {
            out.tile_of_slot.push(tile);
            out.global_from_slot.push(global);
        });
    }
    out
}

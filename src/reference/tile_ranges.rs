//! Twin of `tile_ranges.comp`: each tile's range in the sorted list of intersections; an empty range lies
//! where they would be.

/// Ranges by tile, given a list that is sorted by tile.
pub fn tile_ranges(isect_tiles: &[u32], tiles: usize) -> Vec<[u32; 2]> {
    let begin = |tile: usize| isect_tiles.partition_point(|&t| (t as usize) < tile) as u32;
    (0..tiles).map(|tile| [begin(tile), begin(tile + 1)]).collect()
}

/// Tiles that blending would change: those with intersections, and those marked in `drawn`. Updates `drawn`
/// to the former.
pub fn listed_tiles(ranges: &[[u32; 2]], drawn: &mut [u32]) -> Vec<u32> {
    let mut tiles = Vec::new();
    for (tile, ([begin, end], drawn)) in (0..).zip(ranges.iter().zip(drawn)) {
        let occupied = begin < end;
        if occupied || *drawn != 0 {
            tiles.push(tile);
        }
        *drawn = occupied.into();
    }
    tiles
}

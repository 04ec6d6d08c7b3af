//! Begin and end of each tile's intersections in the list sorted by tile; both where they would be, where there is none.

/// By tile, of a list that is sorted by tile.
pub fn tile_ranges(isect_tiles: &[u32], tiles: usize) -> Vec<[u32; 2]> {
    let begin = |tile: usize| isect_tiles.partition_point(|&t| (t as usize) < tile) as u32;
    (0..tiles).map(|tile| [begin(tile), begin(tile + 1)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_cover_the_list_and_empty_tiles_have_none() {
        assert_eq!(tile_ranges(&[1, 1, 3], 5), [[0, 0], [0, 2], [2, 2], [2, 3], [3, 3]]);
        assert_eq!(tile_ranges(&[], 2), [[0, 0]; 2]);
    }
}

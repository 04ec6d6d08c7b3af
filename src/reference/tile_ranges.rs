//! Begin and end of each tile's intersections in the list sorted by tile; [0, 0] where there is none.

/// By tile, of a list that is sorted by tile.
pub fn tile_ranges(isect_tiles: &[u32], tiles: usize) -> Vec<[u32; 2]> {
    let mut ranges = vec![[0; 2]; tiles];
    for (i, &tile) in isect_tiles.iter().enumerate() {
        if i == 0 || isect_tiles[i - 1] != tile {
            ranges[tile as usize][0] = i as u32;
        }
        if i + 1 == isect_tiles.len() || isect_tiles[i + 1] != tile {
            ranges[tile as usize][1] = i as u32 + 1;
        }
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_cover_the_list_and_empty_tiles_have_none() {
        assert_eq!(tile_ranges(&[1, 1, 3], 5), [[0, 0], [0, 2], [0, 0], [2, 3], [0, 0]]);
        assert_eq!(tile_ranges(&[], 2), [[0, 0]; 2]);
    }
}

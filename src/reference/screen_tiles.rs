//! Twin of `screen_tiles.comp`: the loss's tiles that matter to the 2D Gaussians of a view.

use std::collections::BTreeSet;

use super::Splat;

/// Radius of the SSIM window, px.
pub const WINDOW_RADIUS: f64 = 5.0;

/// Tiles of `tile` × `tile` pixels, numbered row by row, with a pixel centre within `halo` pixels of the
/// bounding box of a visible splat. With a halo of 0 these are the tiles whose gradient is used, with
/// [`WINDOW_RADIUS`] those from which it is computed.
pub fn screen_tiles(
    splats: &[Splat],
    tile_counts: &[u32],
    width: u32,
    height: u32,
    tile: u32,
    halo: f64,
) -> BTreeSet<u32> {
    let across = width.div_ceil(tile);
    let mut tiles = BTreeSet::new();
    for (s, _) in splats.iter().zip(tile_counts).filter(|(_, count)| **count > 0) {
        let root = (2.0 * (255.0 * s.opacity).ln()).max(0.0).sqrt();
        let reach_x = root * s.l12.hypot(s.l22) / (s.l11 * s.l22) + halo;
        let reach_y = root / s.l22 + halo;
        let range = |centre: f64, reach: f64, size: u32| {
            let pixel = |x: f64| x.clamp(0.0, f64::from(size) - 1.0) as u32 / tile;
            pixel((centre - reach - 0.5).ceil())..=pixel((centre + reach - 0.5).floor())
        };
        for y in range(s.y, reach_y, height) {
            tiles.extend(range(s.x, reach_x, width).map(|x| y * across + x));
        }
    }
    tiles
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A round splat of σ = 1 and opacity 1: it reaches √(2 ln 255) = 3.33 px.
    #[test]
    fn tiles_are_those_of_the_box_and_its_halo() {
        let splat = |x: f64, y: f64| Splat { x, y, l11: 1.0, l12: 0.0, l22: 1.0, opacity: 1.0, ..Default::default() };
        let tiles = |s: Splat, halo: f64| Vec::from_iter(screen_tiles(&[s], &[1], 70, 50, 32, halo));
        assert_eq!(tiles(splat(16.0, 16.0), 0.0), [0]);
        assert_eq!(tiles(splat(28.0, 16.0), 0.0), [0]);
        assert_eq!(tiles(splat(28.0, 16.0), WINDOW_RADIUS), [0, 1]);
        assert_eq!(tiles(splat(30.0, 30.0), 0.0), [0, 1, 3, 4]);
        assert_eq!(tiles(splat(69.0, 49.0), WINDOW_RADIUS), [4, 5]);
        assert!(screen_tiles(&[splat(5.0, 5.0)], &[0], 70, 50, 32, 0.0).is_empty());
    }
}

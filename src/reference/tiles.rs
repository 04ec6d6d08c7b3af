//! Finds the tiles that a splat touches: shared by `project`, which counts them, and `emit`, which writes
//! them.
//!
//! The splat covers the ellipse |Lδ|² ≤ t, t = 2 ln(255 · opacity). At the height dy it spans
//! dx = (−l12 dy ± √(t − l22² dy²)) / l11. The right edge is concave in dy and peaks where its derivative
//! −l12 − l22² dy / √(t − l22² dy²) vanishes, at dy = −l12 √t / (l22 h) with h = √(l12² + l22²), where
//! dx = h √t / (l11 l22); the left edge is its point reflection. So over a band of rows each extreme lies at the
//! peak's height clamped into the band, and one pass over the tile rows gives the exact span of each.

use super::{Options, Splat};

/// Tiles over an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tiling {
    /// Width of the image, pixels.
    pub width: u32,
    /// Height of the image, pixels.
    pub height: u32,
    /// Width of a tile, pixels, at least 1.
    pub tile_width: u32,
    /// Height of a tile, pixels, at least 1.
    pub tile_height: u32,
    /// Tiles across.
    pub tiles_x: u32,
    /// Tiles down.
    pub tiles_y: u32,
}

impl Tiling {
    /// The tiles of an image of `width` × `height` pixels; the last of a row or column may reach beyond it.
    pub fn new(width: u32, height: u32, options: &Options) -> Self {
        let (tile_width, tile_height) = (options.tile_width.max(1), options.tile_height.max(1));
        let (tiles_x, tiles_y) = (width.div_ceil(tile_width), height.div_ceil(tile_height));
        Tiling { width, height, tile_width, tile_height, tiles_x, tiles_y }
    }

    /// Number of tiles.
    pub fn count(&self) -> usize {
        self.tiles_x as usize * self.tiles_y as usize
    }

    /// Index of the tile that contains a pixel, rows of tiles from the top.
    pub fn tile_of(&self, column: u32, row: u32) -> u32 {
        row / self.tile_height * self.tiles_x + column / self.tile_width
    }
}

// An extra tile costs a little time, a missing tile is a wrong image: in float32 the set may only err
// outward.
//
// The blend's own rounding, seen from here, is an error of w. Both coordinates carry a relative error of a
// few 2⁻²⁴, and so does l12 dy, which for a needle is much larger than w_u itself: in pixels (divide by l11)
// it is at most the ellipse's half-width. exp within 3 + 2·5.6 ulp and log within 2⁻²¹ (Vulkan's precision)
// move t by less than 1e-5.
/// Relative and absolute growth of t. Covers the errors of t, of w_v and of √(t − w_v²) tenfold.
const SLACK: f64 = 1e-4;
/// Growth of the spans, px. The same as in the kernels (`glsl/shared/splat.glsl`): a kernel and a twin that
/// use each other's counts must list the same tiles.
const PAD: f64 = 1e-3;
/// Growth of the spans by the distance of the centre and the ellipse's ends: 16 roundings of 2⁻²⁴.
const PAD_RELATIVE: f64 = 1.0 / 1048576.0;

/// Visits the tiles that hold the centre of a covered pixel, row by row, left to right. Nothing for an
/// opacity below 1/255, NaN, or an ellipse beside the image.
pub fn for_each_tile(splat: &Splat, tiling: &Tiling, mut visit: impl FnMut(u32)) {
    let t = 2.0 * (255.0 * splat.opacity).ln();
    if !(t >= 0.0) {
        return;
    }
    let t = t * (1.0 + SLACK) + SLACK;
    let root = t.sqrt();
    let h = (splat.l12 * splat.l12 + splat.l22 * splat.l22).sqrt();
    let reach_x = h * root / (splat.l11 * splat.l22);
    let reach_y = root / splat.l22;
    let pad = PAD + PAD_RELATIVE * (reach_x + splat.x.abs());
    let peak = -splat.l12 * root / (splat.l22 * h);

    let row_first = (splat.y - reach_y - PAD - 0.5).ceil().max(0.0);
    let row_last = (splat.y + reach_y + PAD - 0.5).floor().min(tiling.height as f64 - 1.0);
    // Also false if the ellipse is not finite or its position is NaN.
    if !(row_first <= row_last && reach_x < f64::INFINITY && splat.x.is_finite() && splat.y.is_finite()) {
        return;
    }
    let (row_first, row_last) = (row_first as u32, row_last as u32);
    for ty in row_first / tiling.tile_height..=row_last / tiling.tile_height {
        let top = row_first.max(ty * tiling.tile_height);
        let bottom = row_last.min(ty * tiling.tile_height + (tiling.tile_height - 1));
        let low = (top as f64 + 0.5 - splat.y).max(-reach_y).min(reach_y);
        let high = (bottom as f64 + 0.5 - splat.y).max(-reach_y).min(reach_y);

        let right = edge(splat, t, peak.max(low).min(high), 1.0);
        let left = edge(splat, t, (-peak).max(low).min(high), -1.0);
        let column_first = (splat.x + left - pad - 0.5).ceil().max(0.0);
        let column_last = (splat.x + right + pad - 0.5).floor().min(tiling.width as f64 - 1.0);
        if !(column_first <= column_last) {
            continue;
        }
        for tx in column_first as u32 / tiling.tile_width..=column_last as u32 / tiling.tile_width {
            visit(ty * tiling.tiles_x + tx);
        }
    }
}

/// dx of the ellipse's right (side 1) or left (side −1) edge at the height dy.
fn edge(splat: &Splat, t: f64, dy: f64, side: f64) -> f64 {
    let wv = splat.l22 * dy;
    (-splat.l12 * dy + side * (t - wv * wv).max(0.0).sqrt()) / splat.l11
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::reference::ALPHA_MIN;

    /// A random splat in or around a 70 × 50 image: axes log-uniform in 0.55 … 400 px, any angle.
    fn random_splat(rng: &mut ChaCha8Rng) -> Splat {
        let axis = |rng: &mut ChaCha8Rng| {
            if rng.random_bool(0.5) { rng.random_range(0.0..3.0f64) } else { rng.random_range(0.0..6.0f64) }.exp() - 1.0
        };
        let (long, short) = (axis(rng), axis(rng));
        let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
        let m1 = [cos * long, -sin * short];
        let m2 = [sin * long, cos * short];
        let b = m1[0] * m2[0] + m1[1] * m2[1];
        let c = m2[0] * m2[0] + m2[1] * m2[1] + 0.3;
        let d = (long * short).powi(2) + 0.3 * (long * long + short * short) + 0.09;
        Splat {
            x: rng.random_range(-30.0..100.0),
            y: rng.random_range(-30.0..80.0),
            l11: (c / d).sqrt(),
            l12: -b / (c * d).sqrt(),
            l22: 1.0 / c.sqrt(),
            opacity: if rng.random_bool(0.2) { rng.random_range(0.0039..0.006) } else { rng.random_range(0.004..1.0) },
            z: 1.0,
            ..Default::default()
        }
    }

    fn tiling(tile_width: u32, tile_height: u32) -> Tiling {
        Tiling::new(70, 50, &Options { tile_width, tile_height, ..Default::default() })
    }

    /// Tiles with a pixel whose α is at least `alpha_min`.
    fn brute_force(splat: &Splat, tiling: &Tiling, alpha_min: f64) -> BTreeSet<u32> {
        let mut tiles = BTreeSet::new();
        for row in 0..tiling.height {
            for column in 0..tiling.width {
                let (wu, wv) = splat.whiten(column, row);
                if splat.opacity * (-0.5 * (wu * wu + wv * wv)).exp() >= alpha_min {
                    tiles.insert(tiling.tile_of(column, row));
                }
            }
        }
        tiles
    }

    #[test]
    fn no_covered_pixel_is_ever_without_its_tile() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut found, mut needed) = (0, 0);
        for n in 0..6000 {
            let splat = random_splat(&mut rng);
            let tiling = [tiling(16, 16), tiling(8, 8), tiling(16, 4), tiling(7, 3), tiling(1, 1)][n % 5];
            let mut tiles = Vec::new();
            for_each_tile(&splat, &tiling, |tile| tiles.push(tile));
            assert!(tiles.is_sorted_by(|a, b| a < b) && tiles.iter().all(|&tile| (tile as usize) < tiling.count()));
            let tiles: BTreeSet<u32> = tiles.into_iter().collect();
            let covered = brute_force(&splat, &tiling, ALPHA_MIN);
            assert!(tiles.is_superset(&covered), "{splat:?} {:?}", covered.difference(&tiles));
            if n % 5 == 4 {
                // Tiles of one pixel: the pad of 1e-3 px changes ln α by at most pad · l11 · √t + … < 0.03.
                assert!(tiles.is_subset(&brute_force(&splat, &tiling, ALPHA_MIN * (-0.03f64).exp())), "{splat:?}");
            }
            found += tiles.len();
            needed += covered.len();
        }
        // "Exact" except for spans without a pixel centre in a band: a needle between two pixel rows or
        // columns.
        assert!(needed > 20_000 && (found as f64) < 1.06 * needed as f64, "{found} for {needed}");
    }
}

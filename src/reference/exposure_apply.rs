//! Twin of `exposure_apply.comp`: applies a photograph's map of colors.

/// A photograph's affine map of colors: rows of (M | b). Entry 4 · row + column; column 3 is b.
pub type Map = [f64; 12];

/// The map that changes nothing.
pub const IDENTITY: Map = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// M c + b of each pixel; `image` is RGB and transmittance, which is copied.
pub fn exposure_apply(map: &Map, image: &[[f64; 4]]) -> Vec<[f64; 4]> {
    let pixel = |&[r, g, b, transmittance]: &[f64; 4]| {
        let row = |k: usize| map[4 * k] * r + map[4 * k + 1] * g + map[4 * k + 2] * b + map[4 * k + 3];
        [row(0), row(1), row(2), transmittance]
    };
    image.iter().map(pixel).collect()
}

//! Twin of `composite.comp`: a transparent photograph over another background.

/// The packed pixel `stored` over a background that differs by `change` from the one that its colors lie over, in steps of 1/255. Its high
/// byte is its opacity, from 1 for transparent to 255, and becomes 255; 0, a pixel that does not count, stays.
pub fn composite(stored: u32, change: [i32; 3]) -> u32 {
    let [colors @ .., opacity] = stored.to_le_bytes();
    // The product is exact, so that a half is rounded as a half.
    let more = |c: usize| ((255.0 - f64::from(opacity)) * f64::from(change[c]) / 254.0).round();
    let over = |c: usize| (f64::from(colors[c]) + more(c)).clamp(0.0, 255.0) as u8;
    u32::from_le_bytes([over(0), over(1), over(2), if opacity == 0 { 0 } else { 255 }])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transparent_pixels_take_the_background_and_opaque_ones_do_not() {
        let over = |stored: [u8; 4]| composite(u32::from_le_bytes(stored), [200, -30, 7]).to_le_bytes();
        assert_eq!(over([0, 30, 9, 1]), [200, 0, 16, 255]);
        assert_eq!(over([1, 2, 3, 255]), [1, 2, 3, 255]);
        // Half of it.
        assert_eq!(over([10, 20, 30, 128]), [110, 5, 34, 255]);
        assert_eq!(over([250, 3, 0, 1])[..3], [255, 0, 7]);
        assert_eq!(over([0; 4])[3], 0);
    }
}

//! Looks up harmonics by label.

use super::files::Pixels;
use super::{PALETTE_ROW, Palette, entries};

/// The entries of the palette, and the Gaussians' labels.
pub(super) struct Entries<'a> {
    pub(super) bands: u32,
    count: usize,
    palette: &'a Palette,
    entries: Pixels,
    labels: Pixels,
}

impl<'a> Entries<'a> {
    /// `name` is the name of the image with the entries.
    pub(super) fn new(palette: &'a Palette, name: &str, entries: Pixels, labels: Pixels) -> Result<Self, String> {
        // Version 1 gives neither number; derive them from the image.
        let by_width = (1..=3u32).find(|bands| entries.width == PALETTE_ROW * ((*bands as usize + 1).pow(2) - 1));
        let bands = palette.bands.or(by_width).unwrap_or(1);
        if bands > 3 {
            return Err(format!("has harmonics of {bands} bands, expected 0 to 3"));
        }
        let higher = (bands as usize + 1).pow(2) - 1;
        let (width, expected) = (entries.width, PALETTE_ROW * higher);
        if width != expected {
            return Err(format!("`{name}` is {width} pixels wide, expected {expected} of {bands} bands"));
        }
        // Only whole rows count.
        let there = entries.pixels.len() / higher;
        let count = palette.count.unwrap_or(there);
        if there < count {
            return Err(format!("`{name}` has {there} entries, expected {count} or more"));
        }
        Ok(Entries { bands, count, palette, entries, labels })
    }

    /// Appends the coefficients of Gaussian `i`.
    pub(super) fn read(&self, i: usize, sh: &mut Vec<[f32; 3]>) -> Result<(), String> {
        let [low, high, _, _] = self.labels.pixels[i];
        let label = usize::from(u16::from_le_bytes([low, high]));
        let higher = self.entries.width / PALETTE_ROW;
        if label >= self.count {
            return Err(format!("pixel {i} of the shN labels is {label}, expected less than {}", self.count));
        }
        for &[r, g, b, _] in &self.entries.pixels[label * higher..(label + 1) * higher] {
            sh.push(entries([r, g, b], [&self.palette.codebook[..]; 3], "shN")?);
        }
        Ok(())
    }
}

//! Images side by side: renders and the photograph, a magnified crop of each, and maps of the error.
//!
//! Layout, one column per panel and the ground truth as the last:
//!
//! ```text
//! base          augmented     ground truth     labels
//! image         image         image            the crop framed
//! crop          crop          crop             magnified, if asked for
//! |error|       |error|       colour bar
//! ```

use image::{Rgb, RgbImage};

use crate::{Error, Result, data::srgb::srgb_from_linear};

/// Between neighbouring images and around the whole, pixels.
const GAP: u32 = 4;
const PAPER: Rgb<u8> = Rgb([250, 250, 250]);
const INK: Rgb<u8> = Rgb([30, 30, 34]);
/// Of the frame around the crop: not a colour of photographs.
const FRAME: Rgb<u8> = Rgb([255, 214, 10]);
/// Glyphs are 5 × 7 with one column between them.
const GLYPH_WIDTH: u32 = 5;
const GLYPH_HEIGHT: u32 = 7;
/// The picture's longest side and its pixels at most: 300 MB of RGB.
const MAX_SIDE: u64 = 65_535;
const MAX_PIXELS: u64 = 100_000_000;

/// A rectangle of the images, pixels, shown `magnification` times as large, each pixel a square.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crop {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Pixels of the picture for one of the image, across and down.
    pub magnification: u32,
}

/// A render and its label (ASCII; letters appear as lower case).
#[derive(Debug, Clone, Copy)]
pub struct Panel<'a> {
    /// Above the render.
    pub label: &'a str,
    /// sRGB values, `[height · width · 3]`; clamped to [0, 1] when drawn.
    pub image: &'a [f32],
}

/// Renders of one view beside its photograph.
#[derive(Debug, Clone)]
pub struct Figure<'a> {
    /// Pixels of every image.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// From left to right; the photograph comes after them.
    pub panels: Vec<Panel<'a>>,
    /// 8-bit sRGB, `[height · width · 3]`.
    pub truth: &'a [u8],
    /// A close-up below, and where it is from.
    pub crop: Option<Crop>,
    /// The absolute error (mean over the channels, of values in [0, 1]) at the bright end of the error maps' colours.
    pub full_error: f32,
}

impl Figure<'_> {
    /// Draws the figure.
    pub fn compose(&self) -> Result<RgbImage> {
        self.check()?;
        let (width, height) = (self.width, self.height);
        // Letters of about a twentieth of the image, whole multiples of the font.
        let scale = (height.min(width) / 128).clamp(1, 8);
        let line = (GLYPH_HEIGHT + 4) * scale;
        let (crop_width, crop_height) = match self.crop {
            // Bounded by check().
            Some(c) => (c.width * c.magnification, c.height * c.magnification),
            None => (0, 0),
        };
        let column = width.max(crop_width) as u64 + GAP as u64;
        let total_width = column * (self.panels.len() as u64 + 1) + GAP as u64;
        let crop_row = if self.crop.is_some() { crop_height as u64 + GAP as u64 } else { 0 };
        let total_height = 2 * (line as u64 + height as u64 + GAP as u64) + crop_row + GAP as u64;
        if total_width > MAX_SIDE || total_height > MAX_SIDE || total_width * total_height > MAX_PIXELS {
            return Err(Error::Usage(format!(
                "a side-by-side picture of {total_width} × {total_height} pixels is too large: at most {MAX_SIDE} a side and \
                 {MAX_PIXELS} in all; use a smaller crop magnification or fewer panels"
            )));
        }

        let mut paper = RgbImage::from_pixel(total_width as u32, total_height as u32, PAPER);
        let truth = self.truth.to_vec();
        let shown = self.panels.iter().map(|p| (p.label, to_bytes(p.image)));
        let shown: Vec<(&str, Vec<u8>)> = shown.chain([("ground truth", truth)]).collect();
        for (i, (label, bytes)) in shown.iter().enumerate() {
            let x = GAP + i as u32 * column as u32;
            let mut y = GAP;
            write_label(&mut paper, x, y + 2 * scale, label, scale, column as u32 - GAP);
            y += line;
            blit(&mut paper, x, y, bytes, width, height);
            if let Some(c) = self.crop {
                frame(&mut paper, x + c.x, y + c.y, c.width, c.height);
                magnify(&mut paper, x, y + height + GAP, bytes, width, c);
            }
            y += height + GAP + crop_row as u32;
            match self.panels.get(i) {
                Some(panel) => {
                    write_label(&mut paper, x, y + 2 * scale, "|error|", scale, column as u32 - GAP);
                    let map = error_map(panel.image, self.truth, self.full_error);
                    blit(&mut paper, x, y + line, &map, width, height);
                }
                None => color_bar(&mut paper, x, y + line, width, height, scale, self.full_error),
            }
        }
        Ok(paper)
    }

    fn check(&self) -> Result<()> {
        let (width, height) = (self.width, self.height);
        let expected = (width as u64 * height as u64).saturating_mul(3);
        let wrong = |what: &str, length: usize| {
            Err(Error::Usage(format!(
                "side by side: {what} has {length} values, but images of {width} × {height} pixels (at least 1 × 1) have {expected}"
            )))
        };
        if expected == 0 || self.truth.len() as u64 != expected {
            return wrong("the ground truth", self.truth.len());
        }
        if let Some(panel) = self.panels.iter().find(|p| p.image.len() as u64 != expected) {
            return wrong(&format!("\"{}\"", panel.label), panel.image.len());
        }
        if !(self.full_error > 0.0 && self.full_error.is_finite()) {
            return Err(Error::Usage(format!(
                "side by side: full_error is {}, expected a positive number",
                self.full_error
            )));
        }
        let Some(c) = self.crop else { return Ok(()) };
        let inside = |start: u32, size: u32, of: u32| size > 0 && start as u64 + size as u64 <= of as u64;
        if !inside(c.x, c.width, width) || !inside(c.y, c.height, height) {
            return Err(Error::Usage(format!(
                "side by side: a crop of {} × {} pixels at ({}, {}) is not inside an image of {width} × {height}",
                c.width, c.height, c.x, c.y
            )));
        }
        if c.magnification == 0 || c.magnification as u64 * c.width.max(c.height) as u64 > MAX_SIDE {
            return Err(Error::Usage(format!(
                "side by side: a crop of {} × {} pixels magnified {} times, expected 1 to {MAX_SIDE} pixels",
                c.width, c.height, c.magnification
            )));
        }
        Ok(())
    }
}

/// sRGB values to bytes; clamped, NaN becomes black.
pub fn to_bytes(image: &[f32]) -> Vec<u8> {
    // A cast to an integer saturates and takes NaN to zero.
    image.iter().map(|v| (v * 255.0).round() as u8).collect()
}

/// Absolute error (mean over the channels, clamped to [0, 1]) as a colour of [`color_of`], `full` at the bright end. RGB bytes per pixel.
pub fn error_map(image: &[f32], reference: &[u8], full: f32) -> Vec<u8> {
    let pixels = image.chunks_exact(3).zip(reference.chunks_exact(3));
    pixels
        .flat_map(|(a, b)| {
            let error: f32 = a.iter().zip(b).map(|(a, b)| (a.clamp(0.0, 1.0) - *b as f32 / 255.0).abs()).sum();
            // A render that is not a number is wrong wholly.
            color_of(if error.is_nan() { 1.0 } else { error / (3.0 * full) })
        })
        .collect()
}

/// A colour for t in [0, 1] (clamped): from near black through violet, red and orange to pale yellow, of evenly growing
/// lightness in Oklab (Björn Ottosson, 2020), so that equal steps of the error look equal.
pub fn color_of(t: f32) -> [u8; 3] {
    let t = t.clamp(0.0, 1.0) as f64;
    let lightness = 0.12 + 0.83 * t;
    // Violet (300°) to yellow (105°) the short way through red (30°).
    let hue = (300.0 + 165.0 * t).to_radians();
    let chroma = 0.15 * (std::f64::consts::PI * (0.12 + 0.76 * t)).sin();
    let (a, b) = (chroma * hue.cos(), chroma * hue.sin());
    let cube = |v: f64| v * v * v;
    let l = cube(lightness + 0.3963377774 * a + 0.2158037573 * b);
    let m = cube(lightness - 0.1055613458 * a - 0.0638541728 * b);
    let s = cube(lightness - 0.0894841775 * a - 1.2914855480 * b);
    let linear = [
        4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
        -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
        -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s,
    ];
    linear.map(|v| (srgb_from_linear(v.max(0.0)) * 255.0).round() as u8)
}

// The painters below stay inside the paper: compose() has made room, and put() drops what is outside.

fn put(paper: &mut RgbImage, x: u32, y: u32, color: Rgb<u8>) {
    if let Some(pixel) = paper.get_pixel_mut_checked(x, y) {
        *pixel = color;
    }
}

fn blit(paper: &mut RgbImage, x: u32, y: u32, bytes: &[u8], width: u32, height: u32) {
    for (i, c) in bytes.chunks_exact(3).take(width as usize * height as usize).enumerate() {
        let i = i as u32;
        put(paper, x + i % width, y + i / width, Rgb([c[0], c[1], c[2]]));
    }
}

/// The crop of an image `width` wide, each pixel a square.
fn magnify(paper: &mut RgbImage, x: u32, y: u32, bytes: &[u8], width: u32, crop: Crop) {
    let k = crop.magnification;
    for v in 0..crop.height * k {
        for u in 0..crop.width * k {
            let at = 3 * ((crop.y + v / k) as usize * width as usize + (crop.x + u / k) as usize);
            put(paper, x + u, y + v, Rgb([bytes[at], bytes[at + 1], bytes[at + 2]]));
        }
    }
}

/// One pixel wide, on the outermost pixels of the rectangle.
fn frame(paper: &mut RgbImage, x: u32, y: u32, width: u32, height: u32) {
    for u in 0..width {
        put(paper, x + u, y, FRAME);
        put(paper, x + u, y + height - 1, FRAME);
    }
    for v in 0..height {
        put(paper, x, y + v, FRAME);
        put(paper, x + width - 1, y + v, FRAME);
    }
}

/// A bar of the error colours, zero at the bottom, both ends labelled.
fn color_bar(paper: &mut RgbImage, x: u32, y: u32, width: u32, height: u32, scale: u32, full: f32) {
    let bar = (8 * scale).min(width);
    for v in 0..height {
        let t = if height > 1 { 1.0 - v as f32 / (height - 1) as f32 } else { 1.0 };
        for u in 0..bar {
            put(paper, x + u, y + v, Rgb(color_of(t)));
        }
    }
    let beside = x + bar + 3 * scale;
    let room = (x + width).saturating_sub(beside);
    write_label(paper, beside, y, &format!("{full}"), scale, room);
    write_label(paper, beside, y + height.saturating_sub(GLYPH_HEIGHT * scale), "0", scale, room);
}

/// Writes as many whole letters as fit into `room` pixels.
fn write_label(paper: &mut RgbImage, x: u32, y: u32, text: &str, scale: u32, room: u32) {
    let advance = (GLYPH_WIDTH + 1) * scale;
    // The last letter needs no space after it.
    let fits = ((room + scale) / advance) as usize;
    for (i, letter) in text.chars().take(fits).enumerate() {
        for (row, bits) in glyph(letter).into_iter().enumerate() {
            for column in (0..GLYPH_WIDTH).filter(|c| bits >> (GLYPH_WIDTH - 1 - c) & 1 == 1) {
                for s in 0..scale * scale {
                    let u = i as u32 * advance + column * scale + s % scale;
                    put(paper, x + u, y + row as u32 * scale + s / scale, INK);
                }
            }
        }
    }
}

/// Rows of a letter from the top, the left pixel in bit 4. What the font lacks is a box.
#[rustfmt::skip]
fn glyph(letter: char) -> [u8; GLYPH_HEIGHT as usize] {
    match letter.to_ascii_lowercase() {
        ' ' => [0; 7],
        'a' => [0, 0, 0b01110, 0b00001, 0b01111, 0b10001, 0b01111],
        'b' => [0b10000, 0b10000, 0b11110, 0b10001, 0b10001, 0b10001, 0b11110],
        'c' => [0, 0, 0b01110, 0b10000, 0b10000, 0b10001, 0b01110],
        'd' => [0b00001, 0b00001, 0b01111, 0b10001, 0b10001, 0b10001, 0b01111],
        'e' => [0, 0, 0b01110, 0b10001, 0b11111, 0b10000, 0b01110],
        'f' => [0b00110, 0b01001, 0b01000, 0b11100, 0b01000, 0b01000, 0b01000],
        'g' => [0, 0b01111, 0b10001, 0b10001, 0b01111, 0b00001, 0b01110],
        'h' => [0b10000, 0b10000, 0b10110, 0b11001, 0b10001, 0b10001, 0b10001],
        'i' => [0b00100, 0, 0b01100, 0b00100, 0b00100, 0b00100, 0b01110],
        'j' => [0b00010, 0, 0b00110, 0b00010, 0b00010, 0b10010, 0b01100],
        'k' => [0b10000, 0b10000, 0b10010, 0b10100, 0b11000, 0b10100, 0b10010],
        'l' => [0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        'm' => [0, 0, 0b11010, 0b10101, 0b10101, 0b10101, 0b10101],
        'n' => [0, 0, 0b10110, 0b11001, 0b10001, 0b10001, 0b10001],
        'o' => [0, 0, 0b01110, 0b10001, 0b10001, 0b10001, 0b01110],
        'p' => [0, 0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000],
        'q' => [0, 0b01111, 0b10001, 0b10001, 0b01111, 0b00001, 0b00001],
        'r' => [0, 0, 0b10110, 0b11001, 0b10000, 0b10000, 0b10000],
        's' => [0, 0, 0b01111, 0b10000, 0b01110, 0b00001, 0b11110],
        't' => [0b01000, 0b01000, 0b11100, 0b01000, 0b01000, 0b01001, 0b00110],
        'u' => [0, 0, 0b10001, 0b10001, 0b10001, 0b10011, 0b01101],
        'v' => [0, 0, 0b10001, 0b10001, 0b10001, 0b01010, 0b00100],
        'w' => [0, 0, 0b10001, 0b10001, 0b10101, 0b10101, 0b01010],
        'x' => [0, 0, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001],
        'y' => [0, 0b10001, 0b10001, 0b10001, 0b01111, 0b00001, 0b01110],
        'z' => [0, 0, 0b11111, 0b00010, 0b00100, 0b01000, 0b11111],
        '0' => [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '2' => [0b01110, 0b10001, 0b00001, 0b00110, 0b01000, 0b10000, 0b11111],
        '3' => [0b01110, 0b10001, 0b00001, 0b00110, 0b00001, 0b10001, 0b01110],
        '4' => [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
        '6' => [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
        '7' => [0b11111, 0b00001, 0b00010, 0b00100, 0b00100, 0b01000, 0b01000],
        '8' => [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
        '9' => [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
        '.' => [0, 0, 0, 0, 0, 0b01100, 0b01100],
        ',' => [0, 0, 0, 0, 0b01100, 0b00100, 0b01000],
        ':' => [0, 0b01100, 0b01100, 0, 0b01100, 0b01100, 0],
        '-' => [0, 0, 0, 0b11111, 0, 0, 0],
        '+' => [0, 0b00100, 0b00100, 0b11111, 0b00100, 0b00100, 0],
        '=' => [0, 0, 0b11111, 0, 0b11111, 0, 0],
        '_' => [0, 0, 0, 0, 0, 0, 0b11111],
        '/' => [0b00001, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b10000],
        '|' => [0b00100; 7],
        '%' => [0b11001, 0b11001, 0b00010, 0b00100, 0b01000, 0b10011, 0b10011],
        '(' => [0b00010, 0b00100, 0b01000, 0b01000, 0b01000, 0b00100, 0b00010],
        ')' => [0b01000, 0b00100, 0b00010, 0b00010, 0b00010, 0b00100, 0b01000],
        _ => [0b11111, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b11111],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::srgb::linear_from_srgb;

    fn luminance(c: [u8; 3]) -> f64 {
        let linear = |b: u8| linear_from_srgb(f64::from(b) / 255.0);
        0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2])
    }

    #[test]
    fn error_colors_grow_evenly_lighter() {
        let lightness = |t: f32| luminance(color_of(t)).cbrt();
        let steps: Vec<f64> = (0..32).map(|i| lightness((i + 1) as f32 / 32.0) - lightness(i as f32 / 32.0)).collect();
        let mean = steps.iter().sum::<f64>() / 32.0;
        // Rounding to bytes and the cut at the gamut's border shift a step, never turn it.
        assert!(steps.iter().all(|s| *s > 0.3 * mean && *s < 2.0 * mean), "{steps:?}");
        assert_eq!(color_of(f32::INFINITY), color_of(1.0));
    }

    #[test]
    fn error_maps_scale_by_the_full_error() {
        let map = error_map(&[0.0, 0.0, 0.0, 0.6, 0.0, 0.0, f32::NAN, 0.0, 0.0], &[0; 9], 0.4);
        assert_eq!(map, [color_of(0.0), color_of(0.5), color_of(1.0)].concat());
    }

    fn figure<'a>(image: &'a [f32], truth: &'a [u8]) -> Figure<'a> {
        Figure {
            width: 10,
            height: 6,
            panels: vec![Panel { label: "base", image }, Panel { label: "augmented", image }],
            truth,
            crop: Some(Crop { x: 2, y: 1, width: 4, height: 3, magnification: 5 }),
            full_error: 0.25,
        }
    }

    #[test]
    fn panels_crops_and_maps_lie_where_the_layout_says() {
        let truth: Vec<u8> = (0..180).collect();
        let image: Vec<f32> = truth.iter().map(|b| *b as f32 / 255.0).collect();
        let picture = figure(&image, &truth).compose().unwrap();
        let line = GLYPH_HEIGHT + 4;
        // Columns as wide as the crop, 20 pixels.
        assert_eq!(picture.dimensions(), (GAP + 3 * (20 + GAP), GAP + 2 * (line + 6 + GAP) + 15 + GAP));
        for column in 0..3 {
            let (x, y) = (GAP + column * (20 + GAP), GAP + line);
            assert_eq!(picture.get_pixel(x + 9, y + 5).0, [177, 178, 179]);
            assert_eq!(*picture.get_pixel(x + 2, y + 1), FRAME);
            // The crop's last pixel is image pixel (5, 3), value 3 · 35.
            assert_eq!(picture.get_pixel(x + 19, y + 6 + GAP + 14).0, [105, 106, 107]);
            if column < 2 {
                assert_eq!(picture.get_pixel(x, y + 6 + GAP + 15 + GAP + line).0, color_of(0.0));
            }
        }
    }

    #[test]
    fn what_does_not_fit_is_an_error_that_says_so() {
        let (image, truth) = (vec![0.0; 180], vec![0; 180]);
        let good = figure(&image, &truth);
        let message = |f: Figure| f.compose().unwrap_err().to_string();
        assert!(message(Figure { truth: &truth[1..], ..good.clone() }).contains("the ground truth has 179"));
        assert!(message(Figure { width: u32::MAX, height: u32::MAX, ..good.clone() }).contains("the ground truth"));
        let short = Panel { label: "short", image: &image[..3] };
        assert!(message(Figure { panels: vec![short], ..good.clone() }).contains("\"short\" has 3"));
        assert!(message(Figure { full_error: f32::NAN, ..good.clone() }).contains("full_error"));
        let crop = Crop { x: u32::MAX, y: 0, width: 4, height: 3, magnification: 1 };
        assert!(message(Figure { crop: Some(crop), ..good.clone() }).contains("not inside"));
        for magnification in [0, u32::MAX, 16_000] {
            let crop = Some(Crop { x: 0, y: 0, width: 4, height: 3, magnification });
            let message = message(Figure { crop, ..good.clone() });
            assert!(message.contains("magnif"), "{message}");
        }
    }

    #[test]
    fn every_printable_glyph_in_the_font_is_distinct() {
        let letters = "abcdefghijklmnopqrstuvwxyz0123456789.,:-+=_/|%() #";
        let mut glyphs: Vec<_> = letters.chars().map(glyph).collect();
        glyphs.sort();
        glyphs.dedup();
        assert_eq!(glyphs.len(), letters.len());
    }
}

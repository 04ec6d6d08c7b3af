//! Photos as files: sizes, decoding, alpha, and their way to the size and pinhole camera that training sees.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Cursor, Seek};
use std::path::Path;

use image::{DynamicImage, ImageFormat, ImageReader, Limits};

use super::distortion::Lens;
use crate::{Error, Result};

/// Beyond this side a float32 pixel coordinate has fewer than 8 fractional bits.
const MAX_SIDE: u32 = 1 << 15;
/// 268 megapixels, more than any camera's sensor; 16-bit RGBA of that size decodes to 2 GiB.
const MAX_PIXELS: u64 = 1 << 28;
/// No file holds more pixels than this in each of its bytes, so a header that says so is wrong, and is refused before memory is
/// spent on it. PNG: deflate repeats at most 258 bytes with 2 bits, 1032 in a byte, of 8 pixels each.
const PNG_PIXELS_PER_BYTE: u64 = 1032 * 8;
/// JPEG: at least a bit for each block of 8 × 8. The most pixels for a block are in a unit of 32 × 32 with two components of
/// 4 × 1 and 1 × 4 blocks.
const JPEG_PIXELS_PER_BYTE: u64 = 8 * 32 * 32 / (4 + 4);

/// An 8-bit sRGB image: 3 bytes per pixel, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    pub width: u32,
    pub height: u32,
    pub rgb: Vec<u8>,
}

/// The same in floats, 0 to 1, between decoding and quantisation.
pub(super) struct Pixels {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) rgb: Vec<[f32; 3]>,
}

impl Pixels {
    /// Bilinear value at a position in pixels (centres at +0.5), clamped to the edge; not-a-number reads the first pixel.
    pub(super) fn sample(&self, x: f64, y: f64) -> [f32; 3] {
        let split = |at: f64, size: u32| {
            let last = size as usize - 1;
            let at = (at - 0.5).max(0.0).min(last as f64);
            let low = at as usize;
            (low, (low + 1).min(last), (at - low as f64) as f32)
        };
        let ((x0, x1, tx), (y0, y1, ty)) = (split(x, self.width), split(y, self.height));
        let at = |x: usize, y: usize| self.rgb[y * self.width as usize + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        std::array::from_fn(|i| {
            let (top, bottom) = (a[i] + (b[i] - a[i]) * tx, c[i] + (d[i] - c[i]) * tx);
            top + (bottom - top) * ty
        })
    }

    /// The mean over the area of each output pixel, as a sensor with fewer, larger cells would see it. Not for enlarging.
    fn shrink(&self, width: u32, height: u32) -> Pixels {
        let (columns, rows) = (coverage(self.width, width), coverage(self.height, height));
        let mut narrow = Vec::with_capacity(width as usize * self.height as usize);
        for row in self.rgb.chunks_exact(self.width as usize) {
            narrow.extend(columns.iter().map(|(first, weights)| mean(weights, |i| row[first + i])));
        }
        let mut rgb = Vec::with_capacity(width as usize * height as usize);
        for (first, weights) in &rows {
            rgb.extend((0..width as usize).map(|x| mean(weights, |i| narrow[(first + i) * width as usize + x])));
        }
        Pixels { width, height, rgb }
    }

    fn quantise(&self) -> Image {
        let rgb = self.rgb.iter().flatten().map(|&v| super::write::to_byte(v)).collect();
        Image { width: self.width, height: self.height, rgb }
    }
}

fn mean(weights: &[f32], value: impl Fn(usize) -> [f32; 3]) -> [f32; 3] {
    let mut sum = [0.0; 3];
    for (i, weight) in weights.iter().enumerate() {
        let value = value(i);
        (0..3).for_each(|c| sum[c] += weight * value[c]);
    }
    sum
}

/// For each of `to` cells laid over `from` pixels: the first pixel it touches and the shares, summing to 1, of each.
fn coverage(from: u32, to: u32) -> Vec<(usize, Vec<f32>)> {
    let cell = from as f64 / to as f64;
    let span = |i: u32| {
        let (begin, end) = (i as f64 * cell, ((i + 1) as f64 * cell).min(from as f64));
        let first = begin as usize;
        // A sliver that is only rounding error gets a weight of its size.
        let pixels = first..(end.ceil() as usize).clamp(first + 1, from as usize);
        let share = |p: usize| (end.min((p + 1) as f64) - begin.max(p as f64)).max(0.0) / (end - begin);
        (first, pixels.map(|p| share(p) as f32).collect())
    };
    (0..to).map(span).collect()
}

/// `path` is only named in errors, here and below.
fn reader<R: BufRead + Seek>(input: R, path: &Path) -> Result<ImageReader<R>> {
    // By content: endings lie often enough.
    let mut reader = ImageReader::new(input).with_guessed_format().map_err(|source| Error::io(path, source))?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_PIXELS * 8);
    reader.limits(limits);
    Ok(reader)
}

fn decode_error(path: &Path, error: image::ImageError) -> Error {
    let text = error.to_string();
    let text = text.trim_end();
    match error {
        image::ImageError::IoError(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => {
            Error::io(path, source)
        }
        image::ImageError::Unsupported(_) => Error::input(path, format!("is not a PNG or JPEG image: {text}")),
        _ => Error::input(path, format!("cannot be decoded: {text}")),
    }
}

/// Width and height from the file's header.
pub(super) fn size(path: &Path) -> Result<[u32; 2]> {
    let at = |source| Error::io(path, source);
    let file = File::open(path).map_err(at)?;
    let length = file.metadata().map_err(at)?.len();
    header(BufReader::new(file), length, path)
}

/// Width and height from the header of an image of `length` bytes.
fn header(input: impl BufRead + Seek, length: u64, path: &Path) -> Result<[u32; 2]> {
    let reader = reader(input, path)?;
    let densest = if reader.format() == Some(ImageFormat::Jpeg) { JPEG_PIXELS_PER_BYTE } else { PNG_PIXELS_PER_BYTE };
    let (width, height) = reader.into_dimensions().map_err(|error| decode_error(path, error))?;
    let pixels = width as u64 * height as u64;
    // guard: images: sizes
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE || pixels > MAX_PIXELS {
        let what = format!("is {width} × {height}; sides of 1 to {MAX_SIDE} and at most {MAX_PIXELS} pixels are read");
        return Err(Error::input(path, what));
    }
    // guard: images: what their bytes can hold
    if pixels > length.saturating_mul(densest) {
        let what = format!("says that it is {width} × {height}, more than {length} bytes can hold");
        return Err(Error::input(path, what));
    }
    Ok([width, height])
}

/// The size with the longer side at most `max_size`, never enlarged, each side at least 1.
pub(super) fn fit([width, height]: [u32; 2], max_size: Option<u32>) -> [u32; 2] {
    let longer = width.max(height);
    match max_size {
        Some(limit) if limit < longer => {
            [width, height].map(|side| ((side as f64 * limit as f64 / longer as f64).round() as u32).max(1))
        }
        _ => [width, height],
    }
}

/// Decodes, puts alpha over `background` (sRGB values, as NeRF does), takes out the lens and shrinks, in this order.
/// Orientation tags are ignored, as structure-from-motion tools ignore them.
pub(super) fn load(
    path: &Path,
    expected: [u32; 2],
    lens: Option<&Lens>,
    to: [u32; 2],
    background: [f32; 3],
) -> Result<Image> {
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    // The header again: the file may have changed, and its size has to be sound before memory is spent on it.
    let found = header(Cursor::new(&bytes), bytes.len() as u64, path)?;
    // guard: images: the size they had
    if found != expected {
        let [[w, h], [ew, eh]] = [found, expected];
        return Err(Error::input(path, format!("is {w} × {h} now, but was {ew} × {eh} when the dataset was opened")));
    }
    decode(&bytes, path, expected, lens, to, background)
}

/// Decodes `bytes` as [`load`] does, in the size they say.
pub(super) fn check(bytes: &[u8], path: &Path) -> Result<()> {
    let size = header(Cursor::new(bytes), bytes.len() as u64, path)?;
    decode(bytes, path, size, None, size, [0.0; 3]).map(drop)
}

fn decode(
    bytes: &[u8],
    path: &Path,
    expected: [u32; 2],
    lens: Option<&Lens>,
    to: [u32; 2],
    background: [f32; 3],
) -> Result<Image> {
    // guard: images: ends
    if jpeg_is_cut(bytes) {
        return Err(Error::input(path, "is a JPEG image without its end, as half a download leaves it"));
    }
    let reader = reader(Cursor::new(bytes), path)?;
    // A damaged JPEG can overflow arithmetic of the decoder (zune-jpeg 0.5.15, `receive_extend`; found by fuzzing), which panics
    // where overflow is checked, as in debug builds. The reader is gone afterwards, so nothing half-done is seen.
    let decoded = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| reader.decode()))
        .map_err(|_| Error::input(path, "cannot be decoded: the image is damaged"))?
        .map_err(|error| decode_error(path, error))?;
    let [width, height] = expected;
    if [decoded.width(), decoded.height()] != expected {
        return Err(Error::input(path, "its pixels have another size than its header says"));
    }
    if lens.is_none() && to == expected && !decoded.color().has_alpha() {
        return Ok(Image { width, height, rgb: decoded.into_rgb8().into_raw() });
    }
    let mut pixels = Pixels { width, height, rgb: composite(decoded, background) };
    if let Some(lens) = lens {
        pixels = lens.undistort(&pixels);
    }
    if to != expected {
        pixels = pixels.shrink(to[0], to[1]);
    }
    Ok(pixels.quantise())
}

/// Whether `bytes` begin a JPEG image (ITU T.81, annex B) that never ends. The decoder fills what is missing with grey and says
/// nothing. Only what follows the first scan's header counts: a thumbnail has an end of its own.
fn jpeg_is_cut(bytes: &[u8]) -> bool {
    const END: [u8; 2] = [0xff, 0xd9];
    if !bytes.starts_with(&[0xff, 0xd8]) {
        return false;
    }
    let mut at = 2;
    while let Some(&[first, second]) = bytes.get(at..at + 2).and_then(|pair| pair.first_chunk()) {
        at += match (first, second) {
            // In coded data a byte 0xff is never followed by 0xd9.
            (0xff, 0xda) => return !bytes[at..].windows(2).any(|pair| pair == END),
            (0xff, 0xd9) => return false,
            // Markers without contents: TEM, RSTn, SOI.
            (0xff, 0x01 | 0xd0..=0xd8) => 2,
            (0xff, 0x02..=0xfe) => match bytes.get(at + 2..at + 4).and_then(|length| length.first_chunk()) {
                Some(&length) => 2 + usize::from(u16::from_be_bytes(length)),
                None => return true,
            },
            // Padding, or what does not belong here.
            _ => 1,
        };
    }
    true
}

fn composite(image: DynamicImage, background: [f32; 3]) -> Vec<[f32; 3]> {
    if !image.color().has_alpha() {
        return image.into_rgb32f().pixels().map(|p| p.0).collect();
    }
    let over = |[r, g, b, a]: [f32; 4]| [r, g, b].map(|v| v * a).into_iter().zip(background.map(|v| v * (1.0 - a)));
    let blend = |p: [f32; 4]| {
        let mut out = [0.0; 3];
        out.iter_mut().zip(over(p)).for_each(|(out, (front, back))| *out = front + back);
        out
    };
    image.into_rgba32f().pixels().map(|p| blend(p.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shrinking_keeps_the_mean_whatever_the_sizes() {
        let (width, height) = (37, 23);
        let rgb: Vec<[f32; 3]> =
            (0..width * height).map(|i| [(i % 7) as f32 / 7.0, (i % 5) as f32 / 5.0, 0.25]).collect();
        let image = Pixels { width, height, rgb };
        let mean = |p: &Pixels, c: usize| p.rgb.iter().map(|v| v[c] as f64).sum::<f64>() / p.rgb.len() as f64;
        for (w, h) in [(36, 22), (18, 11), (10, 7), (1, 1), (37, 3)] {
            let small = image.shrink(w, h);
            assert_eq!(small.rgb.len(), (w * h) as usize);
            for c in 0..3 {
                // Float32 weights: 1e-7 each.
                assert!((mean(&small, c) - mean(&image, c)).abs() < 1e-6, "{w} × {h}");
            }
        }
    }

    #[test]
    fn halving_is_the_mean_of_four() {
        let rgb = (0..16).map(|i| [i as f32; 3]).collect();
        let small = Pixels { width: 4, height: 4, rgb }.shrink(2, 2);
        assert_eq!(small.rgb, [[2.5; 3], [4.5; 3], [10.5; 3], [12.5; 3]]);
    }

    #[test]
    fn coverage_touches_every_pixel_once() {
        for (from, to) in [(5, 3), (100, 99), (3, 1), (4946, 1237), (7, 7), (32768, 32767)] {
            let mut total = vec![0.0f64; from as usize];
            for (first, weights) in coverage(from, to) {
                assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
                weights.iter().enumerate().for_each(|(i, &w)| total[first + i] += w as f64 * from as f64 / to as f64);
            }
            assert!(total.iter().all(|t| (t - 1.0).abs() < 1e-4), "{from} to {to}");
        }
    }

    #[test]
    fn sampling_is_exact_at_centres_and_clamped_outside() {
        let image = Pixels { width: 2, height: 2, rgb: vec![[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]] };
        assert_eq!(image.sample(1.5, 0.5), [1.0; 3]);
        assert_eq!(image.sample(1.0, 1.0), [1.5; 3]);
        assert_eq!(image.sample(-9.0, 1e9), [2.0; 3]);
        assert_eq!(image.sample(f64::NAN, f64::INFINITY), [2.0; 3]);
    }

    #[test]
    fn alpha_is_composited_on_srgb_values() {
        let pixels = image::RgbaImage::from_vec(2, 1, vec![200, 100, 0, 51, 9, 9, 9, 0]).unwrap();
        let out = composite(DynamicImage::ImageRgba8(pixels), [1.0, 0.0, 0.5]);
        let expected = [[0.2 * 200.0 / 255.0 + 0.8, 0.2 * 100.0 / 255.0, 0.4], [1.0, 0.0, 0.5]];
        for (a, b) in out.iter().flatten().zip(expected.iter().flatten()) {
            assert!((a - b).abs() < 1e-6);
        }
    }

    #[test]
    fn sizes_fit_and_never_grow() {
        assert_eq!(fit([4946, 3286], Some(1600)), [1600, 1063]);
        assert_eq!(fit([100, 200], Some(400)), [100, 200]);
        assert_eq!(fit([100, 200], None), [100, 200]);
        assert_eq!(fit([1, 3000], Some(10)), [1, 10]);
    }

    #[test]
    fn what_is_no_image_is_named_and_damage_never_panics() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let fails = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            size(&path).and_then(|s| load(&path, s, None, s, [0.0; 3])).unwrap_err().to_string()
        };
        assert!(fails(b"").contains("a.png"));
        assert!(fails(b"GIF89a").contains("a.png"));
        let mut png = std::io::Cursor::new(Vec::new());
        let mut jpeg = std::io::Cursor::new(Vec::new());
        let image = image::RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 77]));
        image.write_to(&mut png, image::ImageFormat::Png).unwrap();
        image.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
        // The width in a PNG's header, and its checksum.
        let mut huge = png.get_ref().clone();
        huge[16..20].copy_from_slice(&70000u32.to_be_bytes());
        let checksum = crc(&huge[12..29]).to_be_bytes();
        huge[29..33].copy_from_slice(&checksum);
        assert!(fails(&huge).contains("70000 × 7"), "{}", fails(&huge));
        let cut = &jpeg.get_ref()[..jpeg.get_ref().len() - 2];
        assert!(fails(cut).contains("without its end"), "{}", fails(cut));
        for whole in [png.into_inner(), jpeg.into_inner()] {
            for at in 0..whole.len() {
                let mut bytes = whole.clone();
                bytes[at] ^= 0x55;
                std::fs::write(&path, &bytes).unwrap();
                let _ = size(&path).and_then(|s| load(&path, s, None, s, [0.0; 3]));
                std::fs::write(&path, &whole[..at]).unwrap();
                let _ = size(&path).and_then(|s| load(&path, s, None, s, [0.0; 3]));
            }
        }
    }

    #[test]
    fn more_pixels_than_the_bytes_can_hold_are_refused() {
        let mut png = Cursor::new(Vec::new());
        image::RgbImage::new(9, 7).write_to(&mut png, image::ImageFormat::Png).unwrap();
        let mut bytes = png.into_inner();
        bytes[16..20].copy_from_slice(&8000u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&8000u32.to_be_bytes());
        let checksum = crc(&bytes[12..29]).to_be_bytes();
        bytes[29..33].copy_from_slice(&checksum);
        let refused = check(&bytes, Path::new("a.png")).unwrap_err().to_string();
        assert!(refused.contains("bytes can hold"), "{refused}");
    }

    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0u32, |crc, &byte| {
            (0..8).fold(crc ^ byte as u32, |c, _| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 })
        })
    }
}

//! Decodes photos with alpha and masks, and converts them to the size and the pinhole camera of training.

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Cursor, Read, Seek};
use std::path::Path;

use image::{
    DynamicImage, GenericImageView, GrayImage, ImageDecoder, ImageFormat, ImageReader, Limits, metadata::Orientation,
};

use super::lens::Lens;
use super::photo::{Alpha, Image, ImageFile};
use super::reduce::{Reduce, Reducer};
use crate::{Error, Result};

/// Beyond this side a float32 pixel coordinate has fewer than 8 fractional bits.
const MAX_SIDE: u32 = 1 << 15;
/// 268 megapixels, more than any camera's sensor; 16-bit RGBA of that size decodes to 2 GiB.
const MAX_PIXELS: u64 = 1 << 28;
/// PNG: maximum pixels per byte of a file. A header that claims more is wrong, and is refused before memory
/// is allocated. Deflate repeats at most 258 bytes with 2 bits, so 1032 bytes per byte, of 8 pixels each.
/// TIFF's and BMP's own codes repeat less. WebP has codes of no bits at all, so it has no such limit.
const PNG_PIXELS_PER_BYTE: u64 = 1032 * 8;
/// JPEG: maximum pixels per byte of a file; at least a bit for each block of 8 × 8. The most pixels per block
/// are in a unit of 32 × 32 with two components of 4 × 1 and 1 × 4 blocks.
const JPEG_PIXELS_PER_BYTE: u64 = 8 * 32 * 32 / (4 + 4);
/// Threshold for a mean of ones in float32 to count as 1.
const WHOLE: f32 = 0.999;
/// A mask whose largest value is below this holds labels: every label except 0 counts as valid.
const LABELS: f32 = 16.0;
/// Fill values for the missing bytes of a truncated JPEG image, to find the rows that depend on them. Each
/// mixes zeros and ones, since no Huffman table has a code of ones alone.
const FILLERS: [u8; 3] = [0x55, 0x33, 0x0f];
/// Advice for a file that cannot be used.
const NEXT: &str = "convert it, replace it, or remove it and do without";

impl Image {
    /// Downscales the picture by averaging areas. A pixel is valid if all its source pixels are.
    pub fn reduced(&self, to: [u32; 2]) -> Image {
        let width = self.width as usize;
        let counts = |i: usize| self.mask.as_ref().is_none_or(|mask| mask[i]);
        let mut reducer = Reducer::new([self.width, self.height], to, Reduce::Area);
        let mut row = Vec::with_capacity(width);
        for (y, line) in self.rgb.chunks_exact(3 * width).enumerate() {
            row.clear();
            row.extend(line.chunks_exact(3).enumerate().map(|(x, p)| {
                let [r, g, b] = [p[0], p[1], p[2]].map(|byte| f32::from(byte) / 255.0);
                [r, g, b, f32::from(u8::from(counts(y * width + x)))]
            }));
            reducer.feed(&row);
        }
        finish(reducer, to)
    }
}

/// Rounds the result of downscaling to bytes.
fn finish(reducer: Reducer, to: [u32; 2]) -> Image {
    let pixels = reducer.finish();
    let rgb = pixels.iter().flat_map(|&[r, g, b, _]| [r, g, b].map(super::write::to_byte)).collect();
    // A downscaled pixel is valid if all its source pixels are.
    let mask: Vec<bool> = pixels.iter().map(|pixel| pixel[3] > WHOLE).collect();
    let mask = mask.contains(&false).then_some(mask);
    Image { width: to[0], height: to[1], rgb, mask }
}

/// Contents of a file's header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) size: [u32; 2],
    /// Bytes per pixel of the decoded image.
    pub(super) bytes_per_pixel: u8,
    pub(super) has_alpha: bool,
    /// Whether it is a truncated JPEG image.
    pub(super) ends_early: bool,
}

/// A decoded file.
struct Source<'a> {
    /// In one of the forms of [`simplified`].
    pixels: DynamicImage,
    /// Masks of any size. A pixel is valid if it is white in all of them.
    masks: Vec<GrayImage>,
    alpha: Alpha,
    background: [f32; 3],
    lens: Option<&'a Lens>,
    reduce: Reduce,
}

/// Converts pixels of more than 8 bits to four channels of 16 bits or of floats.
fn simplified(image: DynamicImage) -> DynamicImage {
    match image.color().bytes_per_pixel() / image.color().channel_count() {
        1 => image,
        2 => image.into_rgba16().into(),
        _ => image.into_rgba32f().into(),
    }
}

/// Color and opacity of a pixel.
fn pixel(image: &DynamicImage, x: u32, y: u32) -> [f32; 4] {
    let unit = |byte: u8| f32::from(byte) / 255.0;
    match image {
        DynamicImage::ImageRgb8(image) => {
            let [r, g, b] = image.get_pixel(x, y).0;
            [unit(r), unit(g), unit(b), 1.0]
        }
        DynamicImage::ImageRgba8(image) => image.get_pixel(x, y).0.map(unit),
        DynamicImage::ImageRgba16(image) => image.get_pixel(x, y).0.map(|word| f32::from(word) / 65535.0),
        DynamicImage::ImageRgba32F(image) => image.get_pixel(x, y).0,
        image => image.get_pixel(x, y).0.map(unit),
    }
}

impl Source<'_> {
    /// Color of a pixel of the file, then 1 if it is valid or 0 if it is masked.
    fn at(&self, x: u32, y: u32) -> [f32; 4] {
        let [r, g, b, a] = pixel(&self.pixels, x, y);
        let counts = self.masks.iter().all(|mask| {
            // A mask may have another size than its photo.
            let ((w, h), (mw, mh)) = (self.pixels.dimensions(), mask.dimensions());
            let along = |at: u32, of: u32, to: u32| ((2 * at as u64 + 1) * to as u64 / (2 * of as u64)) as u32;
            mask.get_pixel(along(x, w, mw), along(y, h, mh)).0[0] != 0
        });
        match self.alpha {
            Alpha::Mask => [r, g, b, f32::from(u8::from(counts && a >= 0.5))],
            Alpha::Background if a == 1.0 => [r, g, b, f32::from(u8::from(counts))],
            Alpha::Background => {
                let [br, bg, bb] = self.background;
                let over = |front: f32, back: f32| front * a + back * (1.0 - a);
                [over(r, br), over(g, bg), over(b, bb), f32::from(u8::from(counts))]
            }
        }
    }

    /// Bilinear value at a position in pixels (centres at +0.5), clamped to the edges, or wrapped around for
    /// a sphere.
    fn sample(&self, x: f64, y: f64, wraps: bool) -> [f32; 4] {
        let (width, height) = self.pixels.dimensions();
        let clamped = |at: f64, size: u32| {
            let last = size - 1;
            let at = (at - 0.5).max(0.0).min(last as f64);
            let low = at as u32;
            (low, (low + 1).min(last), (at - low as f64) as f32)
        };
        let around = |at: f64, size: u32| {
            let low = (at - 0.5).floor();
            let index = |at: f64| at.rem_euclid(size as f64) as u32 % size;
            (index(low), index(low + 1.0), (at - 0.5 - low) as f32)
        };
        let (x0, x1, tx) = if wraps { around(x, width) } else { clamped(x, width) };
        let (y0, y1, ty) = clamped(y, height);
        let (a, b, c, d) = (self.at(x0, y0), self.at(x1, y0), self.at(x0, y1), self.at(x1, y1));
        std::array::from_fn(|i| {
            let (top, bottom) = (a[i] + (b[i] - a[i]) * tx, c[i] + (d[i] - c[i]) * tx);
            top + (bottom - top) * ty
        })
    }

    /// The picture of a pinhole camera, downscaled to the size `to`, row by row.
    fn prepare(&self, to: [u32; 2]) -> Image {
        let all = self.pixels.dimensions();
        let (width, height) = self.lens.map_or(all, |lens| (lens.view.width, lens.view.height));
        let wraps = self.lens.is_some_and(|lens| lens.distortion == super::Distortion::Equirectangular);
        let mut reducer = Reducer::new([width, height], to, self.reduce);
        let mut row = vec![[0.0; 4]; width as usize];
        for y in 0..height {
            for (pixel, x) in row.iter_mut().zip(0..) {
                *pixel = match self.lens {
                    None => self.at(x, y),
                    Some(lens) => {
                        let (at, inside) = lens.source(x as f64 + 0.5, y as f64 + 0.5);
                        let [r, g, b, counts] = self.sample(at.x, at.y, wraps);
                        [r, g, b, if inside { counts } else { 0.0 }]
                    }
                };
            }
            reducer.feed(&row);
        }
        finish(reducer, to)
    }
}

/// Opens an image with limits. `path` is only used in errors, here and below.
fn reader<R: BufRead + Seek>(input: R, path: &Path) -> Result<ImageReader<R>> {
    // By content, since file endings are often wrong.
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
        image::ImageError::Unsupported(_) => {
            Error::input(path, format!("is not a PNG, JPEG, WebP, TIFF or BMP image: {text}; {NEXT}"))
        }
        _ => Error::input(path, format!("cannot be decoded: {text}; {NEXT}")),
    }
}

/// Reads a file's header.
pub(super) fn open(path: &Path) -> Result<Header> {
    let at = |source| Error::io(path, source);
    let file = File::open(path).map_err(at)?;
    let length = file.metadata().map_err(at)?.len();
    let mut file = BufReader::new(file);
    if !file.fill_buf().map_err(at)?.starts_with(&JPEG_START) {
        return header(file, length, path);
    }
    // The decoder reads the whole file too.
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(at)?;
    Ok(Header { ends_early: jpeg_is_cut(&bytes), ..header(Cursor::new(&bytes), length, path)? })
}

/// The EXIF orientation of a file, 1 to 8; 1 if it has none.
pub(super) fn orientation(path: &Path) -> u8 {
    File::open(path).map_or(1, |file| orientation_in(BufReader::new(file), path))
}

fn orientation_in(input: impl BufRead + Seek, path: &Path) -> u8 {
    let decoder = reader(input, path).map(ImageReader::into_decoder);
    let Ok(Ok(mut decoder)) = decoder else { return 1 };
    let plain = decoder.orientation().map_or(1, Orientation::to_exif);
    if plain != 1 {
        return plain;
    }
    // Some WebP and PNG writers put JPEG's marker in front of the data.
    let exif = decoder.exif_metadata().ok().flatten().unwrap_or_default();
    let marked = exif.strip_prefix(b"Exif\0\0").and_then(Orientation::from_exif_chunk);
    marked.map_or(1, Orientation::to_exif)
}

/// Size of a picture after its rotation by the EXIF orientation.
pub(super) fn upright([width, height]: [u32; 2], orientation: u8) -> [u32; 2] {
    if matches!(orientation, 5..=8) { [height, width] } else { [width, height] }
}

fn turn(mut image: DynamicImage, orientation: u8) -> DynamicImage {
    image.apply_orientation(Orientation::from_exif(orientation).unwrap_or(Orientation::NoTransforms));
    image
}

/// Reads and checks the header of an image of `length` bytes.
fn header(input: impl BufRead + Seek, length: u64, path: &Path) -> Result<Header> {
    let reader = reader(input, path)?;
    let densest = match reader.format() {
        Some(ImageFormat::Jpeg) => JPEG_PIXELS_PER_BYTE,
        Some(ImageFormat::WebP) => u64::MAX,
        _ => PNG_PIXELS_PER_BYTE,
    };
    let decoder = reader.into_decoder().map_err(|error| decode_error(path, error))?;
    let (width, height) = decoder.dimensions();
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
    let color = decoder.color_type();
    let (bytes_per_pixel, has_alpha) = (color.bytes_per_pixel(), color.has_alpha());
    Ok(Header { size: [width, height], bytes_per_pixel, has_alpha, ends_early: false })
}

/// The size with a longer side of at most `max_size`; never enlarges; each side is at least 1.
pub(super) fn fit([width, height]: [u32; 2], max_size: Option<u32>) -> [u32; 2] {
    let longer = width.max(height);
    match max_size {
        Some(limit) if limit < longer => {
            [width, height].map(|side| ((side as f64 * limit as f64 / longer as f64).round() as u32).max(1))
        }
        _ => [width, height],
    }
}

/// Maximum bytes of memory of [`load`], not counting the file's own.
pub(super) fn bytes_to_load(file: &ImageFile, to: [u32; 2]) -> u64 {
    let pixels = |[width, height]: [u32; 2]| width as u64 * height as u64;
    // Twice, because of conversions and the decoder's buffers; plus the mask. The result takes four floats,
    // and finally the bytes.
    (2 * u64::from(file.bytes_per_pixel) + 1) * pixels(file.size) + (16 + 4) * pixels(to)
}

/// Decodes and rotates an image, blends alpha over `background` (sRGB values, as in NeRF) or uses it as a
/// mask, removes the lens, and downscales, in this order. Structure-from-motion tools differ in obeying
/// orientation tags: the camera's size decides.
pub(super) fn load(file: &ImageFile, to: [u32; 2], background: [f32; 3]) -> Result<Image> {
    let path = &file.path;
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    // Check the header again: the file may have changed, and its size must be valid before memory is
    // allocated.
    let found = header(Cursor::new(&bytes), bytes.len() as u64, path)?.size;
    let size = upright(found, file.orientation);
    // guard: images: the size they had
    if size != file.size {
        let [[w, h], [ew, eh]] = [size, file.size];
        return Err(Error::input(path, format!("is {w} × {h} now, but was {ew} × {eh} when the dataset was opened")));
    }
    let decoded = decode(&bytes, path, found)?;
    let mut masks = Vec::new();
    // guard: images: ends
    if jpeg_is_cut(&bytes) {
        let rows = rows_before_the_cut(&decoded, &bytes, path);
        let there = GrayImage::from_fn(found[0], found[1], |_, y| image::Luma([if y < rows { 255 } else { 0 }]));
        masks.push(turn(there.into(), file.orientation).into_luma8());
    }
    drop(bytes);
    let decoded = turn(decoded, file.orientation);
    if let Some(mask) = &file.mask {
        masks.push(read_mask(mask, size, file.orientation)?);
    }
    Ok(prepare(decoded, masks, file.lens.as_ref(), file.alpha, background, file.reduce, to))
}

fn prepare(
    decoded: DynamicImage,
    masks: Vec<GrayImage>,
    lens: Option<&Lens>,
    alpha: Alpha,
    background: [f32; 3],
    reduce: Reduce,
    to: [u32; 2],
) -> Image {
    let [width, height] = to;
    let same_size = [decoded.width(), decoded.height()] == to;
    if lens.is_none() && masks.is_empty() && same_size && !decoded.color().has_alpha() {
        return Image { width, height, rgb: decoded.into_rgb8().into_raw(), mask: None };
    }
    Source { pixels: simplified(decoded), masks, alpha, background, lens, reduce }.prepare(to)
}

/// Reads the mask of a photo of this size, white for valid pixels. The photo may be a downscaled copy. The
/// mask may be upright, have its own EXIF orientation, or lie as the photo's file does.
fn read_mask(path: &Path, photo: [u32; 2], orientation: u8) -> Result<GrayImage> {
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    let size = header(Cursor::new(&bytes), bytes.len() as u64, path)?.size;
    let fits = |turned: &u8| {
        // As for intrinsics: a downscaled side is rounded to whole pixels.
        let ([width, height], [w, h]) = (photo.map(f64::from), upright(size, *turned).map(f64::from));
        let (scale_x, scale_y) = (width / w, height / h);
        !((width - w * scale_y).abs() > 1.0 && (height - h * scale_x).abs() > 1.0)
    };
    let own = || orientation_in(Cursor::new(&bytes), path);
    let turns = [1].into_iter().chain(std::iter::once_with(own)).chain([orientation]);
    let Some(turned) = turns.into_iter().find(fits) else {
        let ([width, height], [w, h]) = (photo, size);
        let what = format!("the mask is {w} × {h}, but its photo is {width} × {height}, of another aspect");
        return Err(Error::input(path, what));
    };
    Ok(where_it_counts(turn(decode(&bytes, path, size)?, turned)))
}

/// Binarises a mask: white if at least half as bright as its brightest pixel, so that soft edges and labels
/// of 0 and 1 both work. If the color is the same everywhere, alpha is the mask; otherwise transparency
/// darkens.
fn where_it_counts(mask: DynamicImage) -> GrayImage {
    let step = if mask.color().bytes_per_pixel() > mask.color().channel_count() { 1.0 / 65535.0 } else { 1.0 / 255.0 };
    let pixels = simplified(mask);
    let (width, height) = pixels.dimensions();
    let all = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(&pixels, x, y));
    let [r, g, b, a] = pixel(&pixels, 0, 0);
    let plain = all().all(|pixel| pixel[..3] == [r, g, b]) && all().any(|pixel| pixel[3] != a);
    let value = |[r, g, b, a]: [f32; 4]| if plain { a } else { r.max(g).max(b) * a };
    let largest = all().map(value).fold(0.0, f32::max);
    let least = if largest < (LABELS - 0.5) * step { 0.5 * step } else { 0.5 * largest };
    let white = |x, y| image::Luma([if value(pixel(&pixels, x, y)) >= least { 255 } else { 0 }]);
    GrayImage::from_fn(width, height, white)
}

/// Number of rows of a truncated JPEG image that do not depend on the missing bytes.
fn rows_before_the_cut(decoded: &DynamicImage, bytes: &[u8], path: &Path) -> u32 {
    let size = [decoded.width(), decoded.height()];
    let filled = FILLERS
        .iter()
        .find_map(|&filler| decode(&[bytes, &[filler; 1024][..], &JPEG_END[..]].concat(), path, size).ok());
    let row = decoded.as_bytes().len() / decoded.height() as usize;
    let same = |filled: DynamicImage| {
        let rows = filled.as_bytes().chunks_exact(row).zip(decoded.as_bytes().chunks_exact(row));
        rows.take_while(|(a, b)| a == b).count()
    };
    filled.map_or(0, same) as u32
}

/// Decodes `bytes` like [`load`], at their own size.
pub(super) fn check(bytes: &[u8], path: &Path) -> Result<()> {
    let size = header(Cursor::new(bytes), bytes.len() as u64, path)?.size;
    prepare(decode(bytes, path, size)?, Vec::new(), None, Alpha::Background, [0.0; 3], Reduce::Area, size);
    Ok(())
}

fn decode(bytes: &[u8], path: &Path, expected: [u32; 2]) -> Result<DynamicImage> {
    let reader = reader(Cursor::new(bytes), path)?;
    // A damaged JPEG can overflow arithmetic in the decoder (zune-jpeg 0.5.15, `receive_extend`; found by
    // fuzzing). With overflow checks, as in debug builds, it then panics. The reader is dropped, so no
    // partial state is seen.
    let decoded = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| reader.decode()))
        .map_err(|_| Error::input(path, "cannot be decoded: the image is damaged"))?
        .map_err(|error| decode_error(path, error))?;
    if [decoded.width(), decoded.height()] != expected {
        return Err(Error::input(path, "its pixels have another size than its header says"));
    }
    Ok(decoded)
}

const JPEG_START: [u8; 2] = [0xff, 0xd8];
const JPEG_END: [u8; 2] = [0xff, 0xd9];

/// Whether `bytes` are a truncated JPEG image (ITU T.81, annex B). The decoder silently fills missing data
/// with grey. Only bytes after the first scan's header matter: a thumbnail has its own end marker.
fn jpeg_is_cut(bytes: &[u8]) -> bool {
    if !bytes.starts_with(&JPEG_START) {
        return false;
    }
    let mut at = 2;
    while let Some(&[first, second]) = bytes.get(at..at + 2).and_then(|pair| pair.first_chunk()) {
        at += match (first, second) {
            // In coded data a byte 0xff is never followed by 0xd9.
            (0xff, 0xda) => return !bytes[at..].windows(2).any(|pair| pair == JPEG_END),
            (0xff, 0xd9) => return false,
            // Markers without contents: TEM, RSTn, SOI.
            (0xff, 0x01 | 0xd0..=0xd8) => 2,
            (0xff, 0x02..=0xfe) => match bytes.get(at + 2..at + 4).and_then(|length| length.first_chunk()) {
                Some(&length) => 2 + usize::from(u16::from_be_bytes(length)),
                None => return true,
            },
            // Padding, or invalid bytes.
            _ => 1,
        };
    }
    true
}

#[cfg(test)]
mod tests {
    use image::{ImageBuffer, RgbImage, RgbaImage};

    use super::*;

    fn source(image: DynamicImage, alpha: Alpha, background: [f32; 3]) -> Source<'static> {
        Source { pixels: simplified(image), masks: vec![], alpha, background, lens: None, reduce: Reduce::Area }
    }

    fn two(left: [u8; 4], right: [u8; 4]) -> DynamicImage {
        DynamicImage::ImageRgba8(RgbaImage::from_vec(2, 1, [left, right].concat()).unwrap())
    }

    #[test]
    fn sampling_is_exact_at_centres_clamped_outside_and_goes_round_a_sphere() {
        let grey = DynamicImage::ImageLuma8(GrayImage::from_vec(2, 2, vec![0, 51, 102, 204]).unwrap());
        let image = source(grey, Alpha::Background, [0.0; 3]);
        let at = |x, y, wraps| (image.sample(x, y, wraps)[0] * 255.0 * 1e3).round() / 1e3;
        assert_eq!(at(1.5, 0.5, false), 51.0);
        assert_eq!(at(1.0, 1.0, false), 89.25);
        assert_eq!(at(-9.0, 1e9, false), 102.0);
        assert_eq!(at(f64::NAN, f64::INFINITY, false), 102.0);
        assert_eq!([at(0.0, 0.5, false), at(2.0, 0.5, false)], [0.0, 51.0]);
        assert_eq!([at(0.0, 0.5, true), at(2.0, 0.5, true), at(0.5, 0.5, true)], [25.5, 25.5, 0.0]);
    }

    #[test]
    fn alpha_is_composited_on_srgb_values_or_is_a_mask() {
        let image = || two([200, 100, 0, 51], [9, 8, 7, 0]);
        let out = source(image(), Alpha::Background, [1.0, 0.0, 0.5]);
        let expected = [[0.2 * 200.0 / 255.0 + 0.8, 0.2 * 100.0 / 255.0, 0.4, 1.0], [1.0, 0.0, 0.5, 1.0]];
        for (x, expected) in expected.iter().enumerate() {
            assert!(out.at(x as u32, 0).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6));
        }
        assert_eq!(out.prepare([2, 1]).mask, None);
        let out = source(two([200, 100, 0, 128], [9, 8, 7, 127]), Alpha::Mask, [1.0; 3]).prepare([2, 1]);
        assert_eq!(out, Image { width: 2, height: 1, rgb: vec![200, 100, 0, 9, 8, 7], mask: Some(vec![true, false]) });
        assert_eq!(out.packed(), [0xff00_64c8, 0x0007_0809]);
    }

    #[test]
    fn sixteen_bits_and_floats_become_the_same_bytes() {
        let wide = DynamicImage::ImageRgb16(ImageBuffer::from_vec(1, 1, vec![65535, 32896, 257]).unwrap());
        let float =
            DynamicImage::ImageRgb32F(ImageBuffer::from_vec(1, 1, vec![1.5, 128.0 / 255.0, 1.0 / 255.0]).unwrap());
        for image in [wide, float] {
            assert_eq!(source(image, Alpha::Background, [0.0; 3]).prepare([1, 1]).rgb, [255, 128, 1]);
        }
    }

    #[test]
    fn a_jpeg_is_whole_where_its_scan_ends() {
        // An embedded thumbnail has an end marker of its own.
        let begin = [0xff, 0xd8, 0xff, 0xe1, 0, 6, 7, 7, 0xff, 0xd9, 0xff, 0xda, 0, 2, 1, 2, 3, 0xff, 0, 4];
        let with = |end: &[u8]| jpeg_is_cut(&[&begin[..], end].concat());
        assert!(!with(&[0xff, 0xd9]) && with(&[0xff]) && jpeg_is_cut(&begin[..4]));
        assert!(!jpeg_is_cut(b"no JPEG at all"));
    }

    #[test]
    fn a_reduced_pixel_counts_where_all_it_is_made_of_does() {
        let white = DynamicImage::ImageRgb8(RgbImage::from_pixel(6, 2, image::Rgb([255; 3])));
        let mut all = source(white, Alpha::Background, [0.0; 3]);
        // A mask of half the size: each of its pixels covers two of the photo's.
        all.masks = vec![GrayImage::from_vec(3, 1, vec![255, 1, 0]).unwrap()];
        assert_eq!(all.prepare([6, 2]).mask.unwrap(), [true, true, true, true, false, false].repeat(2));
        assert_eq!(all.prepare([3, 1]).mask.unwrap(), [true, true, false]);
        assert_eq!(all.prepare([2, 1]).mask.unwrap(), [true, false]);
        all.masks = vec![GrayImage::from_vec(1, 1, vec![3]).unwrap()];
        assert_eq!(all.prepare([2, 1]).mask, None);
    }

    #[test]
    fn sizes_fit_and_never_grow() {
        assert_eq!(fit([4946, 3286], Some(1600)), [1600, 1063]);
        assert_eq!(fit([100, 200], Some(400)), [100, 200]);
        assert_eq!(fit([100, 200], None), [100, 200]);
        assert_eq!(fit([1, 3000], Some(10)), [1, 10]);
    }

    fn file(path: &Path) -> Result<ImageFile> {
        let Header { size, bytes_per_pixel, has_alpha, .. } = open(path)?;
        let (path, alpha, reduce) = (path.to_owned(), Alpha::Background, Reduce::Area);
        Ok(ImageFile { path, size, orientation: 1, bytes_per_pixel, has_alpha, lens: None, mask: None, alpha, reduce })
    }

    fn encoded(picture: &RgbImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    /// Changes the size in a PNG's header, and its checksum.
    fn resized(mut png: Vec<u8>, size: [u32; 2]) -> Vec<u8> {
        png[16..24].copy_from_slice(size.map(u32::to_be_bytes).as_flattened());
        let checksum = crc32fast::hash(&png[12..29]).to_be_bytes();
        png[29..33].copy_from_slice(&checksum);
        png
    }

    #[test]
    fn what_is_no_image_is_named_and_damage_never_panics() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let read = || file(&path).and_then(|file| load(&file, file.size, [0.0; 3]));
        let fails = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read().unwrap_err().to_string()
        };
        assert!(fails(b"").contains("a.png") && fails(b"").contains("replace it, or remove it"));
        assert!(fails(b"GIF89a").contains("PNG, JPEG, WebP, TIFF or BMP"));
        let picture = RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 77]));
        let png = encoded(&picture, ImageFormat::Png);
        let huge = resized(png.clone(), [70000, 7]);
        assert!(fails(&huge).contains("70000 × 7"), "{}", fails(&huge));
        for at in 0..png.len() {
            let mut bytes = png.clone();
            bytes[at] ^= 0x55;
            for bytes in [&bytes, &png[..at]] {
                std::fs::write(&path, bytes).unwrap();
                let _ = read();
            }
        }
    }

    /// A picture of noise, so that the data of each block differs.
    fn noise(width: u32, height: u32) -> RgbImage {
        let mut state = 1u32;
        RgbImage::from_fn(width, height, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            image::Rgb([(state >> 24) as u8, (state >> 16) as u8, 90])
        })
    }

    #[test]
    fn of_a_jpeg_that_ends_early_the_rows_count_that_are_there() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jpg");
        let bytes = encoded(&noise(48, 64), ImageFormat::Jpeg);
        let read = |bytes: &[u8], orientation| {
            std::fs::write(&path, bytes).unwrap();
            let size = upright([48, 64], orientation);
            load(&ImageFile { size, orientation, ..file(&path).unwrap() }, size, [0.0; 3]).unwrap()
        };
        let whole = read(&bytes, 1);
        assert!(whole.mask.is_none() && !open(&path).unwrap().ends_early);
        // All pixels are present.
        assert_eq!(read(&bytes[..bytes.len() - 2], 1), whole);
        assert!(open(&path).unwrap().ends_early);
        let header = bytes.windows(2).position(|pair| pair == [0xff, 0xda]).unwrap();
        let half = header + (bytes.len() - header) / 2;
        for cut in [half, bytes.len() - 40] {
            let found = read(&bytes[..cut], 1);
            let counts = found.mask.unwrap();
            let rows = counts.iter().filter(|&&counts| counts).count() / 48;
            // To within a row of blocks, the last of which is partial.
            let there = 64 * (cut - header) / (bytes.len() - header);
            assert!((there.saturating_sub(24)..=there).contains(&rows) && rows > 0, "{rows} of {there}");
            assert!(counts[..48 * rows].iter().all(|&counts| counts));
            assert_eq!(found.rgb[..3 * 48 * rows], whole.rgb[..3 * 48 * rows]);
        }
        // Rotated by a quarter: the bottom of the file is at the left.
        let turned = read(&bytes[..half], 6).mask.unwrap();
        assert!(turned.chunks_exact(64).all(|row| !row[0] && row[63]));
    }

    #[test]
    fn a_mask_counts_where_it_is_half_as_bright_as_it_gets() {
        let gray = |values: [u8; 4]| DynamicImage::from(GrayImage::from_vec(4, 1, values.to_vec()).unwrap());
        let wide = |values: [u16; 4]| DynamicImage::ImageLuma16(ImageBuffer::from_vec(4, 1, values.to_vec()).unwrap());
        let rgba = |pixels: [[u8; 4]; 4]| DynamicImage::from(RgbaImage::from_vec(4, 1, pixels.concat()).unwrap());
        let [black, white] = [[0, 0, 0, 255], [255; 4]];
        for (mask, expected) in [
            // Soft edges after JPEG compression, and a black of 1.
            (gray([0, 22, 233, 255]), [0, 0, 1, 1]),
            (gray([1, 1, 255, 1]), [0, 0, 1, 0]),
            // A darker white, and labels.
            (gray([0, 99, 100, 200]), [0, 0, 1, 1]),
            (gray([0, 1, 0, 1]), [0, 1, 0, 1]),
            (gray([0, 1, 3, 15]), [0, 1, 1, 1]),
            (wide([0, 1, 0, 1]), [0, 1, 0, 1]),
            (wide([0, 300, 65535, 40000]), [0, 0, 1, 1]),
            (gray([0; 4]), [0; 4]),
            (gray([255; 4]), [1; 4]),
            // Masks in color, as from palettes; in alpha, over white and over black; in both.
            (rgba([black, [0, 0, 200, 255], [128, 0, 0, 255], [9, 20, 0, 255]]), [0, 1, 1, 0]),
            (rgba([white, [255, 255, 255, 0], [255, 255, 255, 120], white]), [1, 0, 0, 1]),
            (rgba([black, [0; 4], black, [0; 4]]), [1, 0, 1, 0]),
            (rgba([white, [255, 255, 255, 0], black, [0; 4]]), [1, 0, 0, 0]),
            (rgba([black; 4]), [0; 4]),
        ] {
            let found = where_it_counts(mask.clone()).into_raw();
            assert_eq!(found, expected.map(|counts| 255 * counts), "{mask:?}");
        }
    }

    #[test]
    fn masks_of_another_aspect_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let (photo, mask) = (folder.path().join("a.png"), folder.path().join("m.png"));
        RgbImage::new(8, 6).save(&photo).unwrap();
        let with = |width, height| {
            GrayImage::from_fn(width, height, |x, _| image::Luma([u8::from(x < width / 2)])).save(&mask).unwrap();
            load(&ImageFile { mask: Some(mask.clone()), ..file(&photo).unwrap() }, [8, 6], [0.0; 3])
        };
        for (width, height) in [(80, 60), (4, 3), (8, 6)] {
            assert_eq!(
                with(width, height).unwrap().mask.unwrap()[..8],
                [true, true, true, true, false, false, false, false]
            );
        }
        // Oriented like the photo's file.
        let turned = read_mask(&mask, [6, 8], 6).unwrap();
        assert_eq!(turned.dimensions(), (6, 8));
        assert_eq!((turned.get_pixel(0, 0)[0], turned.get_pixel(0, 7)[0]), (255, 0), "left is now the top");
        let message = with(6, 8).unwrap_err().to_string();
        assert!(message.contains("m.png") && message.contains("6 × 8") && message.contains("8 × 6"), "{message}");
    }

    #[test]
    fn more_pixels_than_the_bytes_can_hold_are_refused() {
        let bytes = resized(encoded(&RgbImage::new(9, 7), ImageFormat::Png), [8000; 2]);
        let refused = check(&bytes, Path::new("a.png")).unwrap_err().to_string();
        assert!(refused.contains("bytes can hold"), "{refused}");
    }
}

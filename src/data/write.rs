//! Writes images: 32-bit EXR and 8-bit PNG. All files appear whole or not at all.

use std::io::{self, Write};
use std::path::Path;

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, SmallVec, WritableImage};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::atomic::write_whole;
use crate::{Error, Result};

/// Nearest 8-bit value of `value` in 0 to 1; values outside are clamped, NaN becomes 0.
pub fn to_byte(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// Writes a text file.
pub fn write_text(path: impl AsRef<Path>, text: &str) -> Result<()> {
    write_whole(path.as_ref(), |file| file.write_all(text.as_bytes()))
}

/// Writes float32 RGB, `rgb` interleaved with 3 values per pixel and rows from the top, without clamping or
/// conversion.
pub fn write_exr_rgb(path: impl AsRef<Path>, width: u32, height: u32, rgb: &[f32]) -> Result<()> {
    let path = path.as_ref();
    check(path, width, height, 3, rgb.len())?;
    let plane = |channel: usize| rgb.iter().skip(channel).step_by(3).copied().collect();
    write_exr(path, width, height, [("R", plane(0)), ("G", plane(1)), ("B", plane(2))])
}

/// Writes one float32 channel (`Z` is the usual name of depth, `Y` of grey), one value per pixel, rows from
/// the top.
pub fn write_exr_channel(path: impl AsRef<Path>, width: u32, height: u32, name: &str, values: &[f32]) -> Result<()> {
    let path = path.as_ref();
    check(path, width, height, 1, values.len())?;
    write_exr(path, width, height, [(name, values.to_vec())])
}

fn write_exr<const N: usize>(path: &Path, width: u32, height: u32, planes: [(&str, Vec<f32>); N]) -> Result<()> {
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> =
        planes.into_iter().map(|(name, plane)| AnyChannel::new(name, FlatSamples::F32(plane))).collect();
    let size = (width as usize, height as usize);
    let image = exr::prelude::Image::from_channels(size, AnyChannels::sort(channels));
    // The encoder seeks, so make the bytes in memory first. In parallel, the order of chunks in the file
    // would depend on thread timing.
    let mut bytes = io::Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).map_err(|error| Error::io(path, io::Error::other(error)))?;
    write_whole(path, |file| file.write_all(bytes.get_ref()))
}

/// Writes 8-bit RGB from floats in 0 to 1, interleaved, rows from the top; see [`to_byte`].
pub fn write_png_rgb(path: impl AsRef<Path>, width: u32, height: u32, rgb: &[f32]) -> Result<()> {
    let bytes: Vec<u8> = rgb.iter().map(|&v| to_byte(v)).collect();
    write_png_bytes(path, width, height, &bytes)
}

/// Writes 8-bit RGB unchanged, interleaved, rows from the top.
pub fn write_png_bytes(path: impl AsRef<Path>, width: u32, height: u32, rgb: &[u8]) -> Result<()> {
    check(path.as_ref(), width, height, 3, rgb.len())?;
    write_png(path.as_ref(), width, height, rgb, ExtendedColorType::Rgb8)
}

/// Writes 8-bit grey from floats in 0 to 1, one per pixel, rows from the top; see [`to_byte`].
pub fn write_png_gray(path: impl AsRef<Path>, width: u32, height: u32, values: &[f32]) -> Result<()> {
    check(path.as_ref(), width, height, 1, values.len())?;
    let bytes: Vec<u8> = values.iter().map(|&v| to_byte(v)).collect();
    write_png(path.as_ref(), width, height, &bytes, ExtendedColorType::L8)
}

fn write_png(path: &Path, width: u32, height: u32, bytes: &[u8], color: ExtendedColorType) -> Result<()> {
    write_whole(path, |file| PngEncoder::new(file).write_image(bytes, width, height, color).map_err(io::Error::other))
}

fn check(path: &Path, width: u32, height: u32, channels: u64, values: usize) -> Result<()> {
    let needed = width as u64 * height as u64 * channels;
    if width == 0 || height == 0 || needed != values as u64 {
        let what =
            format!("an image of {width} × {height} with {channels} channels needs {needed} values, got {values}");
        return Err(Error::Usage(format!("{}: {what}", path.display())));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use exr::prelude::*;

    use super::*;

    #[test]
    fn bytes_are_rounded_and_clamped() {
        for byte in 0..=255u8 {
            assert_eq!(to_byte(byte as f32 / 255.0), byte);
        }
        let odd = [-1.0, 2.0, f32::NAN, f32::INFINITY, 0.49 / 255.0, 0.51 / 255.0];
        assert_eq!(odd.map(to_byte), [0, 255, 0, 255, 0, 1]);
    }

    #[test]
    fn exr_keeps_every_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let values: Vec<f32> = (0..5 * 3 * 3).map(|i| (i as f32 - 9.0) * 1e3 / 7.0).collect();
        write_exr_rgb(&path, 5, 3, &values).unwrap();
        let read = |name: &str| {
            let image = read_first_flat_layer_from_file(&path).unwrap();
            assert_eq!(image.layer_data.size, Vec2(5, 3));
            let channel = image.layer_data.channel_data.list.into_iter().find(|c| c.name.eq(name)).unwrap();
            channel.sample_data.values_as_f32().collect::<Vec<_>>()
        };
        for (channel, name) in ["R", "G", "B"].into_iter().enumerate() {
            assert_eq!(read(name), values.iter().skip(channel).step_by(3).copied().collect::<Vec<_>>());
        }
        let depth = [f32::INFINITY, 0.0, -3.5, f32::MAX, 1e-40].repeat(3);
        write_exr_channel(&path, 5, 3, "Z", &depth).unwrap();
        assert_eq!(read("Z"), depth);
    }

    /// Large enough for several chunks, whose order would otherwise depend on threads.
    #[test]
    fn an_exr_has_the_same_bytes_every_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let values: Vec<f32> = (0..200 * 150).map(|i| (i as f32).sin()).collect();
        let bytes = || {
            write_exr_channel(&path, 200, 150, "Z", &values).unwrap();
            std::fs::read(&path).unwrap()
        };
        let first = bytes();
        (0..20).for_each(|_| assert!(bytes() == first));
    }

    #[test]
    fn png_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let values: Vec<f32> = (0..18).map(|i| i as f32 / 17.0).collect();
        write_png_rgb(&path, 3, 2, &values).unwrap();
        let read = image::open(&path).unwrap();
        assert_eq!(read.as_rgb8().unwrap().as_raw(), &values.iter().map(|&v| to_byte(v)).collect::<Vec<_>>());
        write_png_gray(&path, 3, 6, &values).unwrap();
        assert_eq!(image::open(&path).unwrap().as_luma8().unwrap().dimensions(), (3, 6));
        let bytes: Vec<u8> = (0..18).collect();
        write_png_bytes(&path, 2, 3, &bytes).unwrap();
        assert_eq!(image::open(&path).unwrap().as_rgb8().unwrap().as_raw(), &bytes);
    }

    #[test]
    fn wrong_lengths_are_refused() {
        let short = write_exr_rgb("a.exr", 2, 2, &[0.0; 11]);
        for result in [short, write_png_gray("a.png", 0, 2, &[]), write_png_bytes("a.png", 1, 1, &[0; 4])] {
            assert!(matches!(result, Err(crate::Error::Usage(_))));
        }
    }
}

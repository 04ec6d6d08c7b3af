//! Writes SOG archives.

use std::collections::HashMap;
use std::io::{self, Cursor, Write};
use std::path::Path;

use glam::DVec3;
use image::ExtendedColorType;
use image::codecs::webp::WebPEncoder;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::codebook::Codebook;
use super::{Coded, FIRST_LARGEST, Images, META, Means, Meta, PALETTE_ROW, Palette, cluster};
use crate::data::formats::common::{name, put};
use crate::data::formats::{order, quantise};
use crate::data::{SceneFile, TrainedWith};
use crate::scene::Gaussians;
use crate::{Error, Result};

/// Number of labels of 16 bits.
const MOST_ENTRIES: usize = 1 << 16;
/// Maximum side of a WebP image.
const LONGEST_SIDE: usize = 16383;

/// Writes a ZIP archive. The Gaussians are reordered so that neighbours look alike, which compresses better.
///
/// # Errors
/// [`Error::Usage`] if there are more Gaussians than pixels in the largest image.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, _: Option<u8>) -> Result<Vec<String>> {
    let base = &file.scene.base;
    let most = LONGEST_SIDE * LONGEST_SIDE;
    if base.len() > most {
        let (path, count) = (name(path), base.len());
        return Err(Error::Usage(format!("{path}: SOG holds no more than {most} Gaussians, and there are {count}")));
    }
    let fail = |error| Error::io(path, error);
    let files = encode(&base.reordered(&order::along_curve(&base.means)), file).map_err(fail)?;
    put(path, &archive(&files).map_err(fail)?)?;
    Ok(Vec::new())
}

/// The files of an SOG scene, each with its name: images, and their description last. Origin and settings are those of `file`.
pub(super) fn encode(gaussians: &Gaussians, file: &SceneFile) -> io::Result<Vec<(String, Vec<u8>)>> {
    // Nearly square, both sides multiples of four.
    let width = ((gaussians.len() as f64).sqrt().ceil() as usize).next_multiple_of(4).max(4);
    let height = gaussians.len().div_ceil(width).next_multiple_of(4).max(4);
    let mut encoder = Encoder { files: Vec::new(), size: [width, height] };
    let mut meta = encoder.fill(gaussians)?;
    meta.origin = Some(file.scene.origin.to_array()).filter(|_| file.scene.origin != DVec3::ZERO);
    (meta.antialias, meta.glint) = (file.trained_with.antialiased == Some(true), file.trained_with);
    encoder.files.push((META.into(), serde_json::to_vec(&meta)?));
    Ok(encoder.files)
}

/// An archive of uncompressed files: images are compressed already.
fn archive(files: &[(String, Vec<u8>)]) -> io::Result<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // Without a time stamp, so that equal scenes give equal files.
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, bytes) in files {
        zip.start_file(name, options).map_err(io::Error::other)?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish().map_err(io::Error::other)?.into_inner())
}

struct Encoder {
    files: Vec<(String, Vec<u8>)>,
    /// Size of the images with one pixel per Gaussian.
    size: [usize; 2],
}

impl Encoder {
    fn fill(&mut self, gaussians: &Gaussians) -> io::Result<Meta> {
        let k = gaussians.sh_coefficients();
        let higher: Vec<[f32; 3]> = gaussians.sh.chunks_exact(k).flat_map(|row| row[1..].to_vec()).collect();
        Ok(Meta {
            version: 2,
            count: gaussians.len(),
            antialias: false,
            origin: None,
            glint: TrainedWith::default(),
            means: self.means(&gaussians.means)?,
            scales: {
                let book = Codebook::of(gaussians.log_scales.as_flattened().iter().copied());
                let pixels = gaussians.log_scales.iter().map(|scales| {
                    let [x, y, z] = scales.map(|v| book.index(v));
                    [x, y, z, 255]
                });
                Coded { files: vec![self.pixels("scales.webp", pixels)?], codebook: book.0 }
            },
            quats: Images {
                files: vec![self.pixels("quats.webp", gaussians.quats.iter().map(|&quat| rotation(quat)))?],
            },
            sh0: {
                let constant = || gaussians.sh.iter().step_by(k);
                let book = Codebook::of(constant().flatten().copied());
                let pixels = constant().zip(&gaussians.opacities).map(|(rgb, &opacity)| {
                    let [r, g, b] = rgb.map(|v| book.index(v));
                    [r, g, b, quantise::opacity_byte(opacity)]
                });
                Coded { files: vec![self.pixels("sh0.webp", pixels)?], codebook: book.0 }
            },
            sh_n: if higher.is_empty() { None } else { Some(self.harmonics(&higher, gaussians.sh_degree)?) },
        })
    }

    fn means(&mut self, means: &[[f32; 3]]) -> io::Result<Means> {
        let log = |v: f32| f64::from(v).abs().ln_1p() * f64::from(v).signum();
        let logs: Vec<[f64; 3]> = means.iter().map(|mean| mean.map(log)).collect();
        let bound = |pick: fn(f64, f64) -> f64| {
            logs.iter().copied().reduce(|a, b| std::array::from_fn(|axis| pick(a[axis], b[axis]))).unwrap_or_default()
        };
        let (mins, maxs) = (bound(f64::min), bound(f64::max));
        let word = |value: f64, axis: usize| {
            let range = maxs[axis] - mins[axis];
            let share = if range > 0.0 { (value - mins[axis]) / range } else { 0.0 };
            (share * 65535.0).round() as u16
        };
        let words: Vec<[u16; 3]> = logs.iter().map(|l| std::array::from_fn(|axis| word(l[axis], axis))).collect();
        let byte = |which: usize| {
            move |words: &[u16; 3]| {
                let [x, y, z] = words.map(|word| word.to_le_bytes()[which]);
                [x, y, z, 255]
            }
        };
        let low = self.pixels("means_l.webp", words.iter().map(byte(0)))?;
        let high = self.pixels("means_u.webp", words.iter().map(byte(1)))?;
        Ok(Means { mins, maxs, files: vec![low, high] })
    }

    fn harmonics(&mut self, higher: &[[f32; 3]], bands: u32) -> io::Result<Palette> {
        let each = (bands as usize + 1).pow(2) - 1;
        let rows = higher.as_flattened();
        // If there are no more Gaussians than labels, each has its own.
        let groups = cluster::groups(rows, 3 * each, MOST_ENTRIES);
        let book = Codebook::of(groups.iter().flat_map(|(centre, _)| centre.iter().copied()));
        // Merge entries that have become equal.
        let (mut entries, mut known): (Vec<[u8; 4]>, HashMap<Vec<u8>, u16>) = Default::default();
        let mut labels = vec![0u16; higher.len() / each];
        for (centre, members) in &groups {
            let row: Vec<u8> = centre.iter().map(|&v| book.index(v)).collect();
            let next = known.len() as u16;
            let label = *known.entry(row).or_insert_with_key(|row| {
                entries.extend(row.as_chunks::<3>().0.iter().map(|&[r, g, b]| [r, g, b, 255]));
                next
            });
            members.iter().for_each(|&i| labels[i as usize] = label);
        }
        let count = known.len();
        let size = [PALETTE_ROW * each, count.div_ceil(PALETTE_ROW)];
        let pixels = labels.iter().map(|label| {
            let [low, high] = label.to_le_bytes();
            [low, high, 0, 255]
        });
        let files =
            vec![self.image("shN_centroids.webp", size, entries.into_iter())?, self.pixels("shN_labels.webp", pixels)?];
        Ok(Palette { count: Some(count), bands: Some(bands), codebook: book.0, files })
    }

    /// Adds an image with one pixel per Gaussian.
    fn pixels(&mut self, name: &str, pixels: impl Iterator<Item = [u8; 4]>) -> io::Result<String> {
        self.image(name, self.size, pixels)
    }

    fn image(
        &mut self,
        name: &str,
        [width, height]: [usize; 2],
        pixels: impl Iterator<Item = [u8; 4]>,
    ) -> io::Result<String> {
        let mut bytes: Vec<u8> = pixels.flatten().collect();
        bytes.resize(4 * width * height, 0);
        let mut encoded = Vec::new();
        WebPEncoder::new_lossless(&mut encoded)
            .encode(&bytes, width as u32, height as u32, ExtendedColorType::Rgba8)
            .map_err(io::Error::other)?;
        self.files.push((name.into(), encoded));
        Ok(name.into())
    }
}

fn rotation(quat: [f32; 4]) -> [u8; 4] {
    let (largest, smaller) = quantise::smallest_three(quat);
    let [a, b, c] = smaller.map(|v| quantise::byte(127.5 * (v / 0.5f64.sqrt() + 1.0)));
    [a, b, c, FIRST_LARGEST + largest as u8]
}

//! Opens the files of an SOG scene, and decodes its images.

use std::io::Cursor;
use std::path::{Component, Path};

use image::codecs::{png::PngDecoder, webp::WebPDecoder};
use image::{DynamicImage, ImageDecoder, ImageResult, Limits};
use zip::ZipArchive;

use super::super::inflate;
use super::META;

/// An archive, or a folder with its description.
pub(super) enum Files<'a> {
    Archive {
        archive: Box<ZipArchive<Cursor<&'a [u8]>>>,
        /// Prefix of all names.
        prefix: String,
        have: usize,
    },
    Folder {
        meta: &'a [u8],
        folder: Option<&'a Path>,
        /// Bytes read so far.
        have: usize,
    },
}

/// An RGBA image, row by row.
pub(super) struct Pixels {
    pub(super) width: usize,
    pub(super) pixels: Vec<[u8; 4]>,
}

impl<'a> Files<'a> {
    pub(super) fn open(bytes: &'a [u8], folder: Option<&'a Path>) -> Result<Self, String> {
        if bytes.trim_ascii_start().starts_with(b"{") {
            return Ok(Files::Folder { meta: bytes, folder, have: bytes.len() });
        }
        let archive =
            ZipArchive::new(Cursor::new(bytes)).map_err(|error| format!("is not a valid ZIP archive: {error}"))?;
        // Some archives keep all files in a folder.
        let names = archive.file_names().filter_map(|name| name.ok().map(|name| name.into_owned()));
        let meta = names.filter(|name| name == META || name.ends_with(&format!("/{META}"))).min_by_key(String::len);
        let Some(meta) = meta else {
            return Err(format!("is a ZIP archive without `{META}`, so it is not an SOG scene"));
        };
        let prefix = meta[..meta.len() - META.len()].to_owned();
        Ok(Files::Archive { archive: Box::new(archive), prefix, have: bytes.len() })
    }

    /// Bytes of the archive, or of the folder's files read so far.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Files::Archive { have, .. } | Files::Folder { have, .. } => *have,
        }
    }

    /// Reads a file.
    pub(super) fn read(&mut self, name: &str) -> Result<Vec<u8>, String> {
        match self {
            Files::Archive { archive, prefix, have } => {
                let file = archive.by_name(&format!("{prefix}{name}"));
                let file = file.map_err(|error| format!("`{name}` in the archive cannot be read: {error}"))?;
                inflate::zipped(file, *have, name)
            }
            Files::Folder { meta, .. } if name == META => Ok(meta.to_vec()),
            Files::Folder { folder, have, .. } => {
                let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
                let Some(folder) = folder.filter(|_| inside && !name.is_empty()) else {
                    return Err(format!("names `{name}`, expected a file beside it"));
                };
                let bytes = std::fs::read(folder.join(name))
                    .map_err(|error| format!("names `{name}`, which cannot be read: {error}"))?;
                *have += bytes.len();
                Ok(bytes)
            }
        }
    }

    /// Reads an image that should hold about `count` values.
    pub(super) fn image(&mut self, name: &str, count: usize) -> Result<Pixels, String> {
        let bytes = self.read(name)?;
        let have = self.bytes();
        let fail = |error: image::ImageError| format!("`{name}` cannot be decoded: {error}");
        let decoded = match &bytes[..] {
            [b'R', b'I', b'F', b'F', ..] => decode(WebPDecoder::new(Cursor::new(&bytes)), have, name),
            [0x89, b'P', b'N', b'G', ..] => decode(PngDecoder::new(Cursor::new(&bytes)), have, name),
            _ => return Err(format!("`{name}` is no WebP or PNG image (of {count} values)")),
        };
        let image = decoded?.map_err(fail)?.into_rgba8();
        let width = image.width() as usize;
        Ok(Pixels { width, pixels: image.into_raw().as_chunks::<4>().0.to_vec() })
    }
}

/// Checks the size before allocating memory.
fn decode(
    decoder: ImageResult<impl ImageDecoder>,
    have: usize,
    name: &str,
) -> Result<ImageResult<DynamicImage>, String> {
    let mut decoder = match decoder {
        Ok(decoder) => decoder,
        Err(error) => return Ok(Err(error)),
    };
    let (width, height) = decoder.dimensions();
    let bytes = 4 * u64::from(width) * u64::from(height);
    inflate::check_promise(have, bytes, &format!("`{name}`, {width} × {height} pixels"))?;
    let mut limits = Limits::default();
    // The decoder's other memory is of the same order as the pixels.
    limits.max_alloc = Some(8 * bytes + (1 << 20));
    if let Err(error) = decoder.set_limits(limits) {
        return Ok(Err(error));
    }
    Ok(DynamicImage::from_decoder(decoder))
}

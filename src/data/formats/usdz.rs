//! Reads and writes `.usdz`: a ZIP archive whose first file is a stage's root layer, here a `.usda`.
//!
//! Source: "Usdz File Format Specification", openusd.org, version 1.3. Nothing is compressed, and each file's data begin at a multiple of
//! 64 bytes. OpenUSD walks through the headers before the files, so these have the sizes, in 32 bits.

use std::io::{self, BufWriter, Cursor, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::{Kind, inflate, usd};
use crate::data::SceneFile;
use crate::data::atomic::write_whole;
use crate::{Error, Result};

/// Name of the root layer in written archives.
const LAYER: &str = "scene.usda";
/// Each file's data begin at a multiple of this, in bytes.
const ALIGNMENT: u16 = 64;

/// Reads a scene. `path` is only used in errors.
pub(in crate::data) fn parse(bytes: &[u8], _: Option<&Path>, path: &Path) -> Result<SceneFile> {
    read(bytes).map_err(|what| Error::input(path, what))
}

fn read(bytes: &[u8]) -> Result<SceneFile, String> {
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|error| format!("is not a valid ZIP archive: {error}"))?;
    let layer = archive.by_index(0).map_err(|error| format!("the archive's first file cannot be read: {error}"))?;
    let name = usd::shown(&layer.name().unwrap_or_default());
    let text = inflate::zipped(layer, bytes.len(), &name)?;
    match Kind::of(&text, Path::new(&name)) {
        Kind::Usda => usd::read(&text).map_err(|what| format!("`{name}` in the archive: {what}")),
        kind => Err(format!("its first file `{name}` is {kind}, expected OpenUSD as text{}", kind.advice())),
    }
}

/// Writes the base as a stage in an archive.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, _: Option<u8>) -> Result<Vec<String>> {
    write_whole(path, |out| {
        let mut zip = ZipWriter::new(out);
        // Without a time stamp, so that equal scenes give equal files.
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        zip.start_file(LAYER, options.with_alignment(ALIGNMENT)).map_err(io::Error::other)?;
        let mut text = BufWriter::new(&mut zip);
        usd::put(file, &mut text).and_then(|()| text.flush()).map_err(|error| match error.kind() {
            // Errors of disks have kinds of their own.
            io::ErrorKind::Other => {
                io::Error::other("a .usdz holds up to 4 GiB, and the scene needs more; write a .usda")
            }
            _ => error,
        })?;
        drop(text);
        zip.finish().map_err(io::Error::other)?;
        Ok(())
    })?;
    Ok(Vec::new())
}

//! Safe decompression, with sizes limited before memory is allocated; and gzip compression.

use std::io::{self, Read, Write};

use flate2::{Compression, read::GzDecoder, write::GzEncoder};
use zip::read::ZipFile;

/// Maximum decompressed bytes per byte of a scene's file. Positions and rotations hardly compress, so real
/// scenes grow 2 to 8 times; gzip's limit is 1,032 and zstd's 32,768.
const BYTES_PER_BYTE: u64 = 256;
/// Decompressed bytes that are always allowed, so that a thousand equal Gaussians may compress to any size.
const FREE_BYTES: u64 = 1 << 20;

/// Fails if `promised` bytes are too many for a file of `have` bytes. `what` names them in the error.
pub(super) fn check_promise(have: usize, promised: u64, what: &str) -> Result<(), String> {
    let most = (have as u64).saturating_mul(BYTES_PER_BYTE).saturating_add(FREE_BYTES);
    if promised <= most {
        return Ok(());
    }
    Err(format!("promises {promised} bytes of {what}, expected no more than {most} of a file of {have} bytes"))
}

/// Decompresses at most `limit` bytes of a gzip stream, and tells whether there are more.
pub(super) fn gzip(bytes: &[u8], limit: u64) -> Result<(Vec<u8>, bool), String> {
    let mut out = Vec::new();
    let mut decoder = GzDecoder::new(bytes).take(limit.saturating_add(1));
    decoder.read_to_end(&mut out).map_err(|error| format!("is not a valid gzip stream: {error}"))?;
    let more = out.len() as u64 > limit;
    out.truncate(usize::try_from(limit).unwrap_or(usize::MAX));
    Ok((out, more))
}

/// Reads a file of a ZIP archive of `have` bytes to its end, which verifies its checksum.
pub(super) fn zipped(mut file: ZipFile<'_, impl Read>, have: usize, name: &str) -> Result<Vec<u8>, String> {
    let fail = |why: String| format!("`{name}` in the archive cannot be read: {why}");
    let size = file.size();
    check_promise(have, size, &format!("`{name}`"))?;
    let mut out = Vec::new();
    file.by_ref().take(size + 1).read_to_end(&mut out).map_err(|error| fail(error.to_string()))?;
    if out.len() as u64 == size { Ok(out) } else { Err(fail(format!("it is not {size} bytes"))) }
}

/// Compresses all bytes to a gzip stream.
pub(super) fn deflate(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// Decompresses a whole zstd stream to exactly `length` bytes, a number that has passed [`check_promise`].
pub(super) fn zstd(bytes: &[u8], length: usize, what: &str) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    out.try_reserve_exact(length).map_err(|error| format!("{what}: {error}"))?;
    let fail = |error: io::Error| format!("the stream of {what} is not valid: {error}");
    zstd::bulk::Decompressor::new().and_then(|mut zstd| zstd.decompress_to_buffer(bytes, &mut out)).map_err(fail)?;
    if out.len() != length {
        return Err(format!("the stream of {what} holds {} bytes, expected {length}", out.len()));
    }
    Ok(out)
}

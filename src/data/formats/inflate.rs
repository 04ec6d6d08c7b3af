//! Decompression that trusts nobody: what comes out is bounded before there is room for it. And gzip's other direction.

use std::io::{self, Read, Write};

use flate2::{Compression, read::GzDecoder, write::GzEncoder};

/// What a scene may become when it is decompressed, for each byte of its file. Its positions and rotations hardly shrink, so real scenes
/// become 2 to 8 times as large; gzip ends at 1,032 and zstd at 32,768.
const BYTES_PER_BYTE: u64 = 256;
/// A scene of a thousand equal Gaussians may be as small as it likes.
const FREE_BYTES: u64 = 1 << 20;

/// Fails if a file of `have` bytes should become `promised` bytes. `what` says of what these are.
pub(super) fn check_promise(have: usize, promised: u64, what: &str) -> Result<(), String> {
    let most = (have as u64).saturating_mul(BYTES_PER_BYTE).saturating_add(FREE_BYTES);
    if promised <= most {
        return Ok(());
    }
    Err(format!("promises {promised} bytes of {what}, expected no more than {most} of a file of {have} bytes"))
}

/// At most `limit` bytes of a gzip stream, and whether there are more.
pub(super) fn gzip(bytes: &[u8], limit: u64) -> Result<(Vec<u8>, bool), String> {
    let mut out = Vec::new();
    let mut decoder = GzDecoder::new(bytes).take(limit.saturating_add(1));
    decoder.read_to_end(&mut out).map_err(|error| format!("is not a sound gzip stream: {error}"))?;
    let more = out.len() as u64 > limit;
    out.truncate(usize::try_from(limit).unwrap_or(usize::MAX));
    Ok((out, more))
}

/// A gzip stream of all.
pub(super) fn deflate(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// All of a zstd stream, which must become `length` bytes; those have passed [`check_promise`].
pub(super) fn zstd(bytes: &[u8], length: usize, what: &str) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    out.try_reserve_exact(length).map_err(|error| format!("{what}: {error}"))?;
    let fail = |error: io::Error| format!("the stream of {what} is not sound: {error}");
    zstd::bulk::Decompressor::new().and_then(|mut zstd| zstd.decompress_to_buffer(bytes, &mut out)).map_err(fail)?;
    if out.len() != length {
        return Err(format!("the stream of {what} holds {} bytes, expected {length}", out.len()));
    }
    Ok(out)
}

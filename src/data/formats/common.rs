//! Helpers of several formats' readers and writers.

use std::io::Write;
use std::path::Path;

use crate::Result;
use crate::data::atomic::write_whole;
use crate::scene::Gaussians;

/// Empty Gaussians with capacity for `count`. The caller has checked that the file has bytes for these.
pub(super) fn room(count: usize, sh_degree: u32) -> Gaussians {
    let mut gaussians = Gaussians { sh_degree, ..Default::default() };
    gaussians.means.reserve_exact(count);
    gaussians.log_scales.reserve_exact(count);
    gaussians.quats.reserve_exact(count);
    gaussians.opacities.reserve_exact(count);
    gaussians.sh.reserve_exact(count * gaussians.sh_coefficients());
    gaussians
}

/// Appends `more`; both get the higher degree of harmonics.
pub(super) fn append(all: &mut Option<Gaussians>, more: Gaussians) {
    match all {
        Some(all) => all.append(more),
        None => *all = Some(more),
    }
}

/// Reads a little-endian float32.
pub(super) fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Writes a file's bytes.
pub(super) fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, |out| out.write_all(bytes))
}

/// A file's name for errors of writers.
pub(super) fn name(path: &Path) -> String {
    path.display().to_string()
}

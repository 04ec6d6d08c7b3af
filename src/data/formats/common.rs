//! What readers and writers of several formats need.

use std::io::Write;
use std::path::Path;

use crate::Result;
use crate::data::atomic::write_whole;
use crate::scene::Gaussians;

/// No Gaussians yet, but room for as many. The caller has compared `count` with what there are bytes for.
pub(super) fn room(count: usize, sh_degree: u32) -> Gaussians {
    let mut gaussians = Gaussians { sh_degree, ..Default::default() };
    gaussians.means.reserve_exact(count);
    gaussians.log_scales.reserve_exact(count);
    gaussians.quats.reserve_exact(count);
    gaussians.opacities.reserve_exact(count);
    gaussians.sh.reserve_exact(count * gaussians.sh_coefficients());
    gaussians
}

/// A number that is in the file as a little-endian float32.
pub(super) fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// Writes a file's bytes.
pub(super) fn put(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, |out| out.write_all(bytes))
}

/// A file's name for errors that a writer gives.
pub(super) fn name(path: &Path) -> String {
    path.display().to_string()
}

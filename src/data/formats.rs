//! Scene files other than PLY: what each keeps of a Gaussian, and how.
//!
//! All of them are read into the units of [`Gaussians`], in the frame of 3DGS PLY files (x right, y down, z to the front), and as
//! they are: whether the numbers are sound is looked at by who asked for them. Bytes come in whole; sizes and counts in a header are
//! believed only as far as the file's own size allows.

mod axes;
mod floaters;
mod gltf;
mod inflate;
mod order;
mod packed_ply;
mod quantise;
mod sog;
mod splat;
mod spz;
mod turn;

use std::path::Path;

pub(super) use gltf::{parse as parse_gltf, write as write_gltf};
pub(super) use packed_ply::{is_packed, unpack, write as write_packed_ply};
pub(super) use sog::{parse as parse_sog, write as write_sog};
pub(super) use splat::{parse as parse_splat, write as write_splat};
pub(super) use spz::{parse as parse_spz, write as write_spz};

use crate::scene::Gaussians;

/// No Gaussians yet, but room for as many. The caller has compared `count` with what there are bytes for.
fn room(count: usize, sh_degree: u32) -> Gaussians {
    let mut gaussians = Gaussians { sh_degree, ..Default::default() };
    gaussians.means.reserve_exact(count);
    gaussians.log_scales.reserve_exact(count);
    gaussians.quats.reserve_exact(count);
    gaussians.opacities.reserve_exact(count);
    gaussians.sh.reserve_exact(count * gaussians.sh_coefficients());
    gaussians
}

/// A number that is in the file as a little-endian float32.
fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// A file's name for errors that a writer gives.
fn name(path: &Path) -> String {
    path.display().to_string()
}

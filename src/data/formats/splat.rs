//! Reads and writes `.splat`: records of 32 bytes, without a header.
//!
//! Source: antimatter15/splat, `convert.py` and `main.js` of its viewer. A record has position and scale
//! (standard deviations, not their logarithms) as three float32 each, then R, G, B and opacity as bytes, then
//! the rotation w, x, y, z as bytes b for (b − 128)/128. The frame is that of the PLY file. Only the constant
//! harmonic is kept.

use std::path::Path;

use super::common::{f32_at, put, room};
use super::quantise;
use crate::data::SceneFile;
use crate::scene::Scene;
use crate::{Error, Result};

/// Bytes per Gaussian.
const RECORD: usize = 32;

/// Reads a scene. `path` is only used in errors.
pub(in crate::data) fn parse(bytes: &[u8], _: Option<&Path>, path: &Path) -> Result<SceneFile> {
    if bytes.is_empty() || !bytes.len().is_multiple_of(RECORD) {
        let (whole, left) = (bytes.len() / RECORD, bytes.len() % RECORD);
        let what =
            format!("is {whole} records of a .splat scene and {left} bytes; expected whole records of {RECORD} bytes");
        return Err(Error::input(path, what));
    }
    let mut out = room(bytes.len() / RECORD, 0);
    for record in bytes.chunks_exact(RECORD) {
        out.means.push([0, 4, 8].map(|at| f32_at(record, at)));
        out.log_scales.push([12, 16, 20].map(|at| quantise::log_scale(f32_at(record, at))));
        out.sh.push([24, 25, 26].map(|at| quantise::color_coefficient(record[at])));
        out.opacities.push(quantise::opacity_logit(record[27]));
        out.quats.push([28, 29, 30, 31].map(|at| (f32::from(record[at]) - 128.0) / 128.0));
    }
    Ok(Scene { base: out, ..Default::default() }.into())
}

/// Writes a scene. Colors are clamped to 0 to 1; harmonics above the constant one are left out.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, _: Option<u8>) -> Result<Vec<String>> {
    let gaussians = &file.scene.base;
    let mut out = Vec::with_capacity(RECORD * gaussians.len());
    let k = gaussians.sh_coefficients();
    for i in 0..gaussians.len() {
        let scales = gaussians.log_scales[i].map(quantise::scale);
        out.extend(gaussians.means[i].iter().chain(&scales).flat_map(|v| v.to_le_bytes()));
        out.extend(gaussians.sh[i * k].map(quantise::color_byte));
        out.push(quantise::opacity_byte(gaussians.opacities[i]));
        out.extend(rotation(gaussians.quats[i]));
    }
    put(path, &out)?;
    Ok(Vec::new())
}

/// −1 is the byte 0, but 1 would be 256. Both quaternions of a rotation are valid; the one with a negative
/// largest component fits.
fn rotation(quat: [f32; 4]) -> [u8; 4] {
    let unit = quantise::unit(quat);
    let largest = unit.into_iter().fold(0.0f64, |most, v| if v.abs() > most.abs() { v } else { most });
    unit.map(|v| quantise::byte(if largest > 0.0 { -v } else { v } * 128.0 + 128.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uses the sign that makes the largest component negative: −1 fits a byte, 1 does not.
    #[test]
    fn a_rotation_is_as_exact_as_its_bytes_allow() {
        assert_eq!(rotation([1.0, 0.0, 0.0, 0.0]), [0, 128, 128, 128]);
        assert_eq!(rotation([0.0, -2.0, 0.0, 0.0]), [128, 0, 128, 128]);
        assert_eq!(rotation([0.6, 0.0, 0.0, -0.8]), [205, 128, 128, 26]);
    }
}

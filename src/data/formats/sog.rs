//! SOG of PlayCanvas: bytes of Gaussians as pixels of lossless WebP images, in a ZIP archive or a folder.
//!
//! Source: "The SOG Format", developer.playcanvas.com, version 2. `meta.json` names the images; pixel i of each, row by row, is of
//! Gaussian i:
//!
//! - means: two images, the low and the high byte of 16 bits between `mins` and `maxs` of sign(v) ln(1 + |v|)
//! - scales: R, G, B as indices into a codebook of logarithms
//! - quats: A − 252 says which of w, x, y, z is the largest, R, G, B are the others in their order, of −√½ to √½
//! - sh0: R, G, B as indices into a codebook of the constant harmonic's coefficients, A the opacity
//! - shN: an image of labels (low byte R, high byte G) and one of what they stand for, 64 entries a row and a pixel for each coefficient,
//!   whose R, G, B are indices into a codebook
//!
//! Version 1, which SuperSplat wrote until August 2025, has no `version` and no codebooks: `mins` and `maxs` in their place, by channel of
//! scales and sh0 (whose A is the logit of the opacity), one of each for shN. The first number of the means' `shape` is the count.
//!
//! The frame is that of PLY.

mod cluster;
mod codebook;
mod files;
mod first;
mod palette;
mod write;

use std::path::Path;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub(in crate::data) use write::write;

use super::common::room;
use super::{inflate, quantise};
use crate::data::scene_file::SOG_META as META;
use crate::data::{SceneFile, TrainedWith};
use crate::scene::Scene;
use crate::{Error, Result};
use files::Files;

/// Entries in a row of the palette of harmonics.
const PALETTE_ROW: usize = 64;
/// The alpha of a rotation whose first component is the largest.
const FIRST_LARGEST: u8 = 252;

#[derive(Debug, Serialize, Deserialize)]
struct Meta {
    version: u32,
    count: usize,
    #[serde(default)]
    antialias: bool,
    /// What positions count from, in the world; other programs pass it over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    origin: Option<[f64; 3]>,
    #[serde(
        default,
        skip_serializing_if = "TrainedWith::is_unknown",
        deserialize_with = "TrainedWith::deserialize_leniently"
    )]
    glint: TrainedWith,
    means: Means,
    scales: Coded,
    quats: Images,
    sh0: Coded,
    #[serde(rename = "shN", default, skip_serializing_if = "Option::is_none")]
    sh_n: Option<Palette>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Means {
    mins: [f64; 3],
    maxs: [f64; 3],
    files: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Coded {
    codebook: Vec<f32>,
    files: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Images {
    files: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Palette {
    /// Not said in version 1, as the bands.
    count: Option<usize>,
    bands: Option<u32>,
    codebook: Vec<f32>,
    files: Vec<String>,
}

/// Only to say of another version what it is.
#[derive(Debug, Deserialize)]
struct Version {
    version: Option<serde_json::Number>,
}

/// `bytes` are an archive's, or a description's whose images
/// are in `folder`; `path` is only named in errors.
pub(in crate::data) fn parse(bytes: &[u8], folder: Option<&Path>, path: &Path) -> Result<SceneFile> {
    read(bytes, folder).map_err(|what| Error::input(path, what))
}

fn read(bytes: &[u8], folder: Option<&Path>) -> Result<SceneFile, String> {
    let mut files = Files::open(bytes, folder)?;
    let text = files.read(META)?;
    let understand = |error: serde_json::Error| format!("`{META}` is not understood: {error}");
    let Version { version } = serde_json::from_slice(&text).map_err(understand)?;
    let (meta, tables) = match version.as_ref().map(serde_json::Number::as_u64) {
        None => first::understand(&text).map_err(|error| {
            format!("`{META}` has no version, so it is read as version 1, which is not understood: {error}")
        })?,
        Some(Some(1)) => first::understand(&text).map_err(understand)?,
        Some(Some(2)) => {
            let meta: Meta = serde_json::from_slice(&text).map_err(understand)?;
            let tables = Tables::of_codebooks(&meta);
            (meta, tables)
        }
        _ => return Err(format!("is SOG version {}; 1 and 2 are read", version.unwrap_or(0.into()))),
    };
    let count = meta.count;
    let mut image = |images: &[String], which: usize, what: &str| {
        let name = images.get(which).ok_or_else(|| format!("`{META}` names {} images of {what}", images.len()))?;
        let image = files.image(name, count)?;
        if image.pixels.len() < count {
            return Err(format!("`{name}` has {} pixels, expected {count} or more of {what}", image.pixels.len()));
        }
        Ok(image)
    };
    // All of the images are there before anything of the size of the count is.
    let means = [image(&meta.means.files, 0, "means")?, image(&meta.means.files, 1, "means")?];
    let quats = image(&meta.quats.files, 0, "quats")?;
    let scales = image(&meta.scales.files, 0, "scales")?;
    let colours = image(&meta.sh0.files, 0, "sh0")?;
    let palette = match &meta.sh_n {
        Some(palette) if palette.bands != Some(0) => {
            let labels = image(&palette.files, 1, "shN labels")?;
            let name = palette.files.first().map_or("", |name| name);
            let entries = files.image(name, palette.count.unwrap_or(0).saturating_mul(15))?;
            Some(palette::Entries::new(palette, name, entries, labels)?)
        }
        _ => None,
    };
    let coefficients = palette.as_ref().map_or(1, |palette| (u64::from(palette.bands) + 1).pow(2));
    let bytes = (size_of::<[f32; 11]>() as u64 + 12 * coefficients).saturating_mul(count as u64);
    inflate::check_promise(files.bytes(), bytes, &format!("{count} Gaussians"))?;
    let mut out = room(count, palette.as_ref().map_or(0, |palette| palette.bands));
    for i in 0..count {
        let [[lr, lg, lb, _], [hr, hg, hb, _]] = [means[0].pixels[i], means[1].pixels[i]];
        let words = [[lr, hr], [lg, hg], [lb, hb]].map(|bytes| f64::from(u16::from_le_bytes(bytes)) / 65535.0);
        out.means.push(std::array::from_fn(|axis| {
            let (low, high) = (meta.means.mins[axis], meta.means.maxs[axis]);
            let value = low + (high - low) * words[axis];
            (value.abs().exp_m1() * value.signum()) as f32
        }));
        let [a, b, c, largest] = quats.pixels[i];
        let Some(largest) = largest.checked_sub(FIRST_LARGEST) else {
            return Err(format!("pixel {i} of the quats has alpha {largest}, expected 252 to 255"));
        };
        let smaller = [a, b, c].map(|byte| (f64::from(byte) / 127.5 - 1.0) * 0.5f64.sqrt());
        out.quats.push(quantise::from_smallest_three(usize::from(largest), smaller));
        let [x, y, z, _] = scales.pixels[i];
        out.log_scales.push(entries([x, y, z], tables.scales.each_ref().map(|table| &table[..]), "scales")?);
        let [r, g, b, opacity] = colours.pixels[i];
        out.sh.push(entries([r, g, b], tables.colours.each_ref().map(|table| &table[..]), "sh0")?);
        out.opacities.push(tables.opacities[usize::from(opacity)]);
        if let Some(palette) = &palette {
            palette.read(i, &mut out.sh)?;
        }
    }
    let origin = meta.origin.map_or(DVec3::ZERO, DVec3::from_array);
    let antialiased = meta.glint.antialiased.or(meta.antialias.then_some(true));
    let trained_with = TrainedWith { antialiased, ..meta.glint };
    let origin = if origin.is_finite() { origin } else { DVec3::ZERO };
    Ok(SceneFile { trained_with, ..Scene { base: out, origin, ..Default::default() }.into() })
}

/// What bytes stand for, by channel.
struct Tables {
    scales: [Vec<f32>; 3],
    colours: [Vec<f32>; 3],
    opacities: [f32; 256],
}

impl Tables {
    fn of_codebooks(meta: &Meta) -> Tables {
        let same = |coded: &Coded| std::array::from_fn(|_| coded.codebook.clone());
        let opacities = std::array::from_fn(|byte| quantise::opacity_logit(byte as u8));
        Tables { scales: same(&meta.scales), colours: same(&meta.sh0), opacities }
    }
}

/// What three bytes stand for in tables of their channels.
fn entries(bytes: [u8; 3], tables: [&[f32]; 3], what: &str) -> Result<[f32; 3], String> {
    let mut out = [0.0; 3];
    for ((slot, byte), codebook) in out.iter_mut().zip(bytes).zip(tables) {
        let entry = codebook.get(usize::from(byte));
        *slot = *entry.ok_or_else(|| format!("{what} have entry {byte} of a codebook of {}", codebook.len()))?;
    }
    Ok(out)
}

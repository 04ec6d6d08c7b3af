//! Reads and writes PlayCanvas' SOG: bytes of Gaussians as pixels of lossless WebP images, in a ZIP archive
//! or a folder.
//!
//! Source: "The SOG Format", developer.playcanvas.com, version 2. `meta.json` names the images; pixel i of
//! each, row by row, belongs to Gaussian i:
//!
//! - means: two images, the low and the high byte of 16 bits between `mins` and `maxs` of sign(v) ln(1 + |v|)
//! - scales: R, G, B as indices into a codebook of logarithms
//! - quats: A − 252 is the index of the largest of w, x, y, z; R, G, B are the others in their order, for −√½
//!   to √½
//! - sh0: R, G, B as indices into a codebook of the constant harmonic's coefficients, A the opacity
//! - shN: an image of labels (low byte R, high byte G) and one of their entries: 64 entries per row and one
//!   pixel per coefficient, with R, G, B as indices into a codebook
//!
//! Version 1, written by SuperSplat until August 2025, has no `version`, and `mins` and `maxs` instead of
//! codebooks: per channel for scales and sh0 (A is the logit of the opacity), a single pair for shN. The
//! first number of the means' `shape` is the count.
//!
//! The frame is that of PLY.

mod cluster;
mod codebook;
mod files;
mod first;
mod palette;
mod streamed;
mod write;

use std::path::Path;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub(in crate::data) use streamed::write as write_streamed;
pub(in crate::data) use write::write;

use super::common::room;
use super::{inflate, quantise};
use crate::data::scene_file::SOG_META;
use crate::data::{SceneFile, TrainedWith};
use crate::scene::Scene;
use crate::{Error, Result};
use files::Files;

/// The description of an SOG scene.
const META: &str = SOG_META[0];
/// Entries in a row of the palette of harmonics.
const PALETTE_ROW: usize = 64;
/// Alpha of a rotation whose largest component is the first.
const FIRST_LARGEST: u8 = 252;

#[derive(Debug, Serialize, Deserialize)]
struct Meta {
    version: u32,
    count: usize,
    #[serde(default)]
    antialias: bool,
    /// World position of the coordinate origin; other programs ignore it.
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
    /// Missing in version 1, as are the bands.
    count: Option<usize>,
    bands: Option<u32>,
    codebook: Vec<f32>,
    files: Vec<String>,
}

/// Only used to name an unsupported version in errors.
#[derive(Debug, Deserialize)]
struct Version {
    version: Option<serde_json::Number>,
}

/// Reads a scene. `bytes` are an archive, or a description with images in `folder`; `path` is only used in
/// errors.
pub(in crate::data) fn parse(bytes: &[u8], folder: Option<&Path>, path: &Path) -> Result<SceneFile> {
    let read = if streamed::is_index(path) { streamed::read } else { read };
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
    // Decode all images before allocating memory by the count.
    let means = [image(&meta.means.files, 0, "means")?, image(&meta.means.files, 1, "means")?];
    let quats = image(&meta.quats.files, 0, "quats")?;
    let scales = image(&meta.scales.files, 0, "scales")?;
    let colors = image(&meta.sh0.files, 0, "sh0")?;
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
        let [r, g, b, opacity] = colors.pixels[i];
        out.sh.push(entries([r, g, b], tables.colors.each_ref().map(|table| &table[..]), "sh0")?);
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

/// Values of bytes, by channel.
struct Tables {
    scales: [Vec<f32>; 3],
    colors: [Vec<f32>; 3],
    opacities: [f32; 256],
}

impl Tables {
    fn of_codebooks(meta: &Meta) -> Tables {
        let same = |coded: &Coded| std::array::from_fn(|_| coded.codebook.clone());
        let opacities = std::array::from_fn(|byte| quantise::opacity_logit(byte as u8));
        Tables { scales: same(&meta.scales), colors: same(&meta.sh0), opacities }
    }
}

/// Looks up three bytes in the tables of their channels.
fn entries(bytes: [u8; 3], tables: [&[f32]; 3], what: &str) -> Result<[f32; 3], String> {
    let mut out = [0.0; 3];
    for ((slot, byte), codebook) in out.iter_mut().zip(bytes).zip(tables) {
        let entry = codebook.get(usize::from(byte));
        *slot = *entry.ok_or_else(|| format!("{what} have entry {byte} of a codebook of {}", codebook.len()))?;
    }
    Ok(out)
}

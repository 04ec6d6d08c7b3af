//! Reads and writes scenes in files of any format.

use std::fs;
use std::path::Path;

#[cfg(feature = "train")]
use glam::DVec3;

use super::formats::Kind;
#[cfg(feature = "train")]
use super::formats::SceneFormat;
use super::ply_columns::BASE;
#[cfg(feature = "train")]
use super::ply_write;
use super::scene_file::{SceneFile, description_in};
#[cfg(feature = "train")]
use super::trained_with::TrainedWith;
use super::validate::{self, Dropped};
#[cfg(feature = "train")]
use crate::scene::Gaussians;
use crate::scene::Scene;
#[cfg(feature = "train")]
use crate::scene::color;
use crate::{Error, Result};

#[cfg(feature = "train")]
/// Writes `scene` as binary little-endian PLY in the reference trainer's order, followed by the supplement,
/// if any. Every float is preserved bit for bit. The file appears whole or not at all.
pub fn write_scene(path: impl AsRef<Path>, scene: &Scene) -> Result<()> {
    write_ply(path, scene, None, TrainedWith::default())
}

#[cfg(feature = "train")]
/// Writes a PLY with a separate base for other viewers; [`write_scene_file`] without building a
/// [`SceneFile`].
///
/// # Errors
/// [`Error::Usage`] if a number is not finite, or if the scene's base does not start with the Gaussians in
/// `shown`.
pub fn write_ply(
    path: impl AsRef<Path>,
    scene: &Scene,
    shown: Option<&Gaussians>,
    trained_with: TrainedWith,
) -> Result<()> {
    let path = path.as_ref();
    sound_or_refused(path, scene)?;
    ply_write::write(path, shown, scene, &trained_with)
}

#[cfg(feature = "train")]
fn sound_or_refused(path: &Path, scene: &Scene) -> Result<()> {
    validate::check(scene)
        .map_err(|what| Error::Usage(format!("{}: this scene cannot be written: {what}", path.display())))
}

#[cfg(feature = "train")]
/// Writes a scene in the format of its file name; see [`SceneFormat`]. The file appears whole or not at all.
/// Returns the notes of [`write_scene_as`].
///
/// # Errors
/// [`Error::Usage`] if the name has no known ending, and the errors of [`write_scene_as`].
pub fn write_scene_file(path: impl AsRef<Path>, file: &SceneFile) -> Result<Vec<String>> {
    let path = path.as_ref();
    let format = SceneFormat::of(path).ok_or_else(|| {
        let endings: Vec<&str> = SceneFormat::ALL.iter().map(|format| format.ending).collect();
        let (path, endings) = (path.display(), endings.join(", "));
        Error::Usage(format!("{path}: no scene is written under this name, expected the ending {endings}"))
    })?;
    write_scene_as(path, format, file)
}

#[cfg(feature = "train")]
/// Writes a scene in the given format, independent of the file name. The file appears whole or not at all.
/// Returns a sentence for each unexpected change: positions on a coarse grid, moved floaters, an origin or
/// settings that the format does not keep ([`SceneFormat::keeps_origin`]).
///
/// # Errors
/// [`Error::Usage`] if the format cannot hold the scene's supplement or one of its numbers, or if a number is
/// not finite.
pub fn write_scene_as(path: impl AsRef<Path>, format: SceneFormat, file: &SceneFile) -> Result<Vec<String>> {
    let path = path.as_ref();
    let refuse = |what: String| Err(Error::Usage(format!("{}: {what}", path.display())));
    let Scene { base, supplement, origin, .. } = &file.scene;
    if let (Some(supplement), false) = (supplement, format.keeps_lobes) {
        let lost = supplement.gaussians.len();
        return refuse(format!("this format has no place for the scene's {lost} Gaussians with lobes"));
    }
    let colors = color::of(base.sh_degree);
    if colors.harmonics.is_none() && !format.keeps_colors {
        let (name, keep) = (colors.name, SceneFormat::endings(|format| format.keeps_colors));
        return refuse(format!("this format has no place for {name}, expected a {keep} or harmonics"));
    }
    sound_or_refused(path, &file.scene)?;
    let Some(write) = format.write else {
        return refuse("this build of glint writes PLY scenes only".into());
    };
    let mut notes = write(file, path, format.version.or(format.levels))?;
    let keep = || SceneFormat::endings(|format| format.keeps_origin);
    if *origin != DVec3::ZERO && !format.keeps_origin {
        let [x, y, z] = origin.to_array();
        notes.push(format!("positions count from ({x}, {y}, {z}), which this format does not keep; {} do", keep()));
    }
    let lost = file.trained_with.options_beyond(format.keeps_antialiased);
    if !format.keeps_origin && !lost.is_empty() {
        let options = lost.join(" ");
        notes.push(format!("what it was trained with is not kept: give {options} to glint; {} keep it", keep()));
    }
    Ok(notes)
}

/// Reads a scene of any known format, with its supplement if it has one. Numbers must be finite in 32 bits,
/// and rotations not zero.
pub fn read_scene(path: impl AsRef<Path>) -> Result<Scene> {
    Ok(read_scene_file(path)?.scene)
}

/// Reads the valid part of a scene. Real exports contain Gaussians with infinite opacities, NaN and the like:
/// [`read_scene`] refuses them, this function drops and counts them.
pub fn read_scene_leniently(path: impl AsRef<Path>) -> Result<(Scene, Dropped)> {
    let (file, dropped) = read_scene_file_leniently(path)?;
    Ok((file.scene, dropped))
}

/// [`read_scene`] with the rest of the file, including the base for other viewers.
pub fn read_scene_file(path: impl AsRef<Path>) -> Result<SceneFile> {
    let path = path.as_ref();
    let (file, kind) = open(path)?;
    checked(file, kind).map_err(|what| Error::input(path, what))
}

/// [`read_scene_leniently`] with the rest of the file, including the base for other viewers.
pub fn read_scene_file_leniently(path: impl AsRef<Path>) -> Result<(SceneFile, Dropped)> {
    let (mut file, kind) = open(path.as_ref())?;
    let mut dropped = validate::drop_faults(&mut file.scene);
    dropped.first = dropped.first.map(|what| named(what, kind));
    if let Some(shown) = file.shown {
        // It matches the scene row by row, so dropping single rows would make it useless.
        let shown = Scene { base: shown, ..Default::default() };
        file.shown = (dropped.base == 0 && validate::check(&shown).is_ok()).then_some(shown.base);
    }
    Ok((file, dropped))
}

/// Fails if this reader finds no valid scene in the bytes. Files that they name are not opened.
#[cfg(feature = "formats")]
pub(super) fn check(read: super::formats::Reader, bytes: &[u8], path: &Path) -> Result<()> {
    let mut file = read(bytes, None, path)?;
    validate::make_finite(&mut file.scene);
    validate::check(&file.scene).map_err(|what| Error::input(path, what))
}

/// Returns the file if its numbers are valid.
fn checked(file: SceneFile, kind: Kind) -> Result<SceneFile, String> {
    validate::check(&file.scene).map_err(|what| named(what, kind))?;
    Ok(file)
}

/// The fault of a row; without the PLY element's name for formats without elements.
fn named(what: String, kind: Kind) -> String {
    if kind == Kind::Ply { what } else { what.replacen(&format!(" of element `{BASE}`"), "", 1) }
}

/// [`read_scene`] from a file's bytes. `path` is used in errors, and decides the format of bytes without a
/// mark of their own; files that the bytes name are read from its folder.
pub fn parse_scene(bytes: &[u8], path: &Path) -> Result<Scene> {
    let (file, kind) = parse(bytes, path)?;
    Ok(checked(file, kind).map_err(|what| Error::input(path, what))?.scene)
}

/// Reads the scene without checking its numbers, and returns the kind of its file.
fn open(path: &Path) -> Result<(SceneFile, Kind)> {
    let path = &description_in(path).unwrap_or_else(|| path.to_owned());
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    parse(&bytes, path)
}

fn parse(bytes: &[u8], path: &Path) -> Result<(SceneFile, Kind)> {
    let kind = Kind::of(bytes, path);
    let Some(read) = kind.reader() else {
        return Err(Error::input(path, format!("is {kind}, not a scene{}", kind.advice())));
    };
    let mut file = read(bytes, path.parent(), path)?;
    validate::make_finite(&mut file.scene);
    file.shown.iter_mut().for_each(validate::make_finite_part);
    Ok((file, kind))
}

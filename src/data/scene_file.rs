//! Scenes in files of any kind: the one place where it is decided by whom a file is read or written.

use std::fs;
#[cfg(feature = "formats")]
use std::io::Write;
use std::path::Path;

#[cfg(feature = "train")]
use glam::DVec3;

use super::kind::Kind;
use super::ply;
#[cfg(feature = "train")]
use super::ply_write;
use super::sound::{self, Dropped};
use super::trained_with::TrainedWith;
#[cfg(feature = "train")]
use crate::scene::layout::colour_name;
use crate::scene::{Gaussians, Scene, layout::BETAS};
use crate::{Error, Result};

/// What a folder with an SOG scene has.
pub(super) const SOG_META: &str = "meta.json";

/// Whether `path` is a folder with a scene.
pub fn is_scene_folder(path: &Path) -> bool {
    path.is_dir() && path.join(SOG_META).is_file()
}

/// A scene, and what viewers show that know nothing of its supplement.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SceneFile {
    /// The base as it has learned together with the supplement.
    pub scene: Scene,
    /// The base for other viewers, where it is not that of the scene.
    pub shown: Option<Gaussians>,
    /// What it was trained with, as far as the file says.
    pub trained_with: TrainedWith,
    /// What was read in another way than it looks, or not read although it changes the picture: a sentence each.
    pub notes: Vec<String>,
}

impl From<Scene> for SceneFile {
    fn from(scene: Scene) -> Self {
        SceneFile { scene, shown: None, trained_with: TrainedWith::default(), notes: Vec::new() }
    }
}

impl SceneFile {
    /// Without the supplement: what other viewers show.
    pub fn into_base(self) -> SceneFile {
        let origin = self.scene.origin;
        let scene = Scene { base: self.shown.unwrap_or(self.scene.base), supplement: None, origin };
        SceneFile { trained_with: self.trained_with, ..scene.into() }
    }
}

/// Kinds of files that scenes are written to, by the ending of their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SceneFormat {
    /// All there is, bit for bit.
    Ply,
    /// PlayCanvas's compressed PLY: all in few bits, between bounds of 256 Gaussians each.
    PackedPly,
    /// Binary glTF with `KHR_gaussian_splatting`: all there is, as float32.
    Gltf,
    /// Niantic's: all in few bits, compressed; 8 for what is not a position. Version 3 holds what 4 does; 2 has coarser rotations, and
    /// 1 positions of 16 bits besides.
    Spz {
        /// 1 to 4.
        version: u8,
    },
    /// PlayCanvas's: pixels of lossless images, numbers of codebooks.
    Sog,
    /// `.splat`: the constant harmonic alone, bytes for all but positions and scales.
    Splat,
}

impl SceneFormat {
    /// All, with the endings of their names.
    pub const ALL: [(&str, SceneFormat); 6] = [
        ("ply", SceneFormat::Ply),
        ("compressed.ply", SceneFormat::PackedPly),
        ("glb", SceneFormat::Gltf),
        ("sog", SceneFormat::Sog),
        ("splat", SceneFormat::Splat),
        ("spz", SceneFormat::Spz { version: 4 }),
    ];

    /// What `path` is called.
    pub fn of(path: &Path) -> Option<SceneFormat> {
        let name = path.file_name()?.to_str()?.to_ascii_lowercase();
        let named = |ending: &str| name.strip_suffix(ending).and_then(|stem| stem.strip_suffix('.')).is_some();
        Self::ALL.into_iter().rev().find(|(ending, _)| named(ending)).map(|(_, format)| format)
    }

    /// Whether a supplement can be kept.
    pub fn keeps_lobes(self) -> bool {
        matches!(self, SceneFormat::Ply | SceneFormat::Gltf)
    }

    /// Whether the file says where in the world its coordinates begin ([`Scene::origin`]) and what it was trained with.
    pub fn keeps_origin(self) -> bool {
        !matches!(self, SceneFormat::Spz { .. } | SceneFormat::Splat)
    }

    /// The greatest degree of harmonics that is kept, or [`BETAS`] where these are.
    pub fn greatest_sh_degree(self) -> u32 {
        match self {
            SceneFormat::Splat => 0,
            SceneFormat::Ply => BETAS,
            _ => 3,
        }
    }
}

#[cfg(feature = "train")]
/// Writes a scene as its name says; see [`SceneFormat`]. The file appears whole or not at all. Returns what [`write_scene_as`] does.
///
/// # Errors
/// [`Error::Usage`] where the name has none of the endings, and as [`write_scene_as`].
pub fn write_scene_file(path: impl AsRef<Path>, file: &SceneFile) -> Result<Vec<String>> {
    let path = path.as_ref();
    let format = SceneFormat::of(path).ok_or_else(|| {
        let endings: Vec<&str> = SceneFormat::ALL.iter().map(|(ending, _)| *ending).collect();
        let (path, endings) = (path.display(), endings.join(", "));
        Error::Usage(format!("{path}: no scene is written under this name, expected the ending {endings}"))
    })?;
    write_scene_as(path, format, file)
}

#[cfg(feature = "train")]
/// Writes a scene in a format of the caller's choice, whatever the file is called. The file appears whole or not at all. Returns what the
/// format changes that nobody would expect, a sentence each: positions on a coarse grid, floaters that were moved, an origin or
/// settings that are not kept ([`SceneFormat::keeps_origin`]).
///
/// # Errors
/// [`Error::Usage`] where the format has no room for the supplement that the scene has or for a number, and where a number is not finite.
pub fn write_scene_as(path: impl AsRef<Path>, format: SceneFormat, file: &SceneFile) -> Result<Vec<String>> {
    let path = path.as_ref();
    let refuse = |what: String| Err(Error::Usage(format!("{}: {what}", path.display())));
    let Scene { base, supplement, origin } = &file.scene;
    if format == SceneFormat::Ply {
        ply_write::write_file(path, file)?;
        return Ok(Vec::new());
    }
    if let (Some(supplement), false) = (supplement, format.keeps_lobes()) {
        let lost = supplement.gaussians.len();
        return refuse(format!("this format has no place for the scene's {lost} Gaussians with lobes"));
    }
    if base.sh_degree == BETAS {
        return refuse(format!("this format has no place for {}, expected a .ply or harmonics", colour_name(BETAS)));
    }
    if let Err(what) = sound::check(&file.scene) {
        return refuse(format!("this scene cannot be written: {what}"));
    }
    let mut notes = write_other(path, format, file)?;
    if *origin != DVec3::ZERO && !format.keeps_origin() {
        let [x, y, z] = origin.to_array();
        notes.push(format!(
            "positions count from ({x}, {y}, {z}), which this format does not keep; .ply, .glb and .sog do"
        ));
    }
    let lost = file.trained_with.options_beyond(matches!(format, SceneFormat::Spz { .. }));
    if !format.keeps_origin() && !lost.is_empty() {
        let options = lost.join(" ");
        notes.push(format!(
            "what it was trained with is not kept: give {options} to glint; .ply, .glb and .sog keep it"
        ));
    }
    Ok(notes)
}

#[cfg(feature = "formats")]
fn write_other(path: &Path, format: SceneFormat, file: &SceneFile) -> Result<Vec<String>> {
    use super::{atomic::write_whole, formats};
    let base = &file.scene.base;
    let antialiased = file.trained_with.antialiased == Some(true);
    let (bytes, notes) = match format {
        SceneFormat::Ply => return ply_write::write_file(path, file).map(|()| Vec::new()),
        SceneFormat::PackedPly => formats::write_packed_ply(file),
        SceneFormat::Gltf => (formats::write_gltf(file, path)?, Vec::new()),
        SceneFormat::Sog => (formats::write_sog(file, path)?, Vec::new()),
        SceneFormat::Splat => (formats::write_splat(base), Vec::new()),
        SceneFormat::Spz { version } => formats::write_spz(base, antialiased, version, path)?,
    };
    write_whole(path, |out| out.write_all(&bytes))?;
    Ok(notes)
}

#[cfg(all(feature = "train", not(feature = "formats")))]
fn write_other(path: &Path, _: SceneFormat, _: &SceneFile) -> Result<Vec<String>> {
    Err(Error::Usage(format!("{}: this build of glint writes PLY scenes only", path.display())))
}

/// Reads a scene of any kind that glint knows, with its supplement if it has one. Numbers must be finite in 32 bits and rotations not
/// zero.
pub fn read_scene(path: impl AsRef<Path>) -> Result<Scene> {
    Ok(read_scene_file(path)?.scene)
}

/// Reads what is sound of a scene. Real exports contain Gaussians with infinite opacities, NaN and the like, which
/// [`read_scene`] refuses; here they are dropped and counted.
pub fn read_scene_leniently(path: impl AsRef<Path>) -> Result<(Scene, Dropped)> {
    let (file, dropped) = read_scene_file_leniently(path)?;
    Ok((file.scene, dropped))
}

/// As [`read_scene`], with what other viewers show.
pub fn read_scene_file(path: impl AsRef<Path>) -> Result<SceneFile> {
    let path = path.as_ref();
    let (file, element) = open(path)?;
    checked(file, element).map_err(|what| Error::input(path, what))
}

/// As [`read_scene_leniently`], with what other viewers show.
pub fn read_scene_file_leniently(path: impl AsRef<Path>) -> Result<(SceneFile, Dropped)> {
    let (mut file, element) = open(path.as_ref())?;
    let mut dropped = sound::drop_faults(&mut file.scene);
    dropped.first = dropped.first.map(|what| named(what, element));
    if let Some(shown) = file.shown {
        // It goes with the scene row by row, so it is sound as a whole or of no use.
        let shown = Scene { base: shown, ..Default::default() };
        file.shown = (dropped.base == 0 && sound::check(&shown).is_ok()).then_some(shown.base);
    }
    Ok((file, dropped))
}

#[cfg(feature = "formats")]
/// The same of a PLY file's bytes. `path` is only named in errors.
pub(super) fn parse_ply(bytes: &[u8], path: &Path) -> Result<Scene> {
    let mut file = ply::parse_rows(bytes, path)?;
    sound::make_finite(&mut file.scene);
    Ok(checked(file, true).map_err(|what| Error::input(path, what))?.scene)
}

/// Fails where the bytes of a file of this kind are no sound scene. Files that they name are not looked for.
#[cfg(feature = "formats")]
pub(super) fn check(kind: Kind, bytes: &[u8], path: &Path) -> Result<()> {
    let Some(mut file) = parse_other(kind, bytes, None, path)? else {
        return Err(Error::input(path, format!("is {kind}, not a scene")));
    };
    sound::make_finite(&mut file.scene);
    checked(file, false).map_err(|what| Error::input(path, what)).map(drop)
}

/// The file, if its numbers are sound.
fn checked(file: SceneFile, element: bool) -> Result<SceneFile, String> {
    sound::check(&file.scene).map_err(|what| named(what, element))?;
    Ok(file)
}

/// What is wrong with a row, without the PLY element's name where the file has no elements.
fn named(what: String, element: bool) -> String {
    if element { what } else { what.replacen(&format!(" of element `{}`", ply::BASE), "", 1) }
}

/// As [`read_scene`], of a file's bytes. `path` is named in errors, and says what the bytes are where they have no mark of
/// their own; files that the bytes name are looked for beside it.
pub fn parse_scene(bytes: &[u8], path: &Path) -> Result<Scene> {
    let (file, element) = parse(bytes, path)?;
    Ok(checked(file, element).map_err(|what| Error::input(path, what))?.scene)
}

/// The scene, whatever its numbers are, and whether its Gaussians are rows of PLY elements.
fn open(path: &Path) -> Result<(SceneFile, bool)> {
    let path = &if path.is_dir() { path.join(SOG_META) } else { path.to_owned() };
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    parse(&bytes, path)
}

fn parse(bytes: &[u8], path: &Path) -> Result<(SceneFile, bool)> {
    let (mut file, element) = parse_as_it_is(bytes, path)?;
    sound::make_finite(&mut file.scene);
    file.shown.iter_mut().for_each(sound::make_finite_part);
    Ok((file, element))
}

fn parse_as_it_is(bytes: &[u8], path: &Path) -> Result<(SceneFile, bool)> {
    let kind = Kind::of(bytes, path);
    #[cfg(feature = "formats")]
    if let Some(gaussians) = parse_other(kind, bytes, path.parent(), path)? {
        return Ok((gaussians, false));
    }
    match kind {
        Kind::Ply => Ok((ply::parse_rows(bytes, path)?, true)),
        #[cfg(feature = "train")]
        Kind::Safetensors => Ok((super::kept::parse_kept(bytes, path)?, false)),
        kind => Err(Error::input(path, format!("is {kind}, not a scene{}", kind.advice()))),
    }
}

/// Kinds other than PLY. Files that the bytes name are looked for in `folder`, if there is one.
#[cfg(feature = "formats")]
fn parse_other(kind: Kind, bytes: &[u8], folder: Option<&Path>, path: &Path) -> Result<Option<SceneFile>> {
    use super::formats;
    let plain = |base| SceneFile::from(Scene { base, ..Default::default() });
    Ok(Some(match kind {
        Kind::Splat => plain(formats::parse_splat(bytes, path)?),
        Kind::Gltf => formats::parse_gltf(bytes, folder, path)?,
        Kind::Zip | Kind::Sog => {
            let (base, origin, trained_with) = formats::parse_sog(bytes, folder, path)?;
            SceneFile { trained_with, ..Scene { base, origin, ..Default::default() }.into() }
        }
        // Version 3 and before are gzip data.
        Kind::Spz | Kind::Gzip => {
            let (base, antialiased) = formats::parse_spz(bytes, path)?;
            // Programs that know nothing of it leave the flag unset.
            let trained_with = TrainedWith { antialiased: antialiased.then_some(true), ..Default::default() };
            SceneFile { trained_with, ..plain(base) }
        }
        _ => return Ok(None),
    }))
}

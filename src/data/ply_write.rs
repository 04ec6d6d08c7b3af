//! Writes scenes to PLY files, the inverse of `ply`.

use std::io::Write;
use std::path::Path;

use glam::DVec3;

use super::atomic::write_whole;
use super::ply_columns::{BANDS, BASE, LEARNED, NO_LOBES, Place, SUPPLEMENT, columns, number};
use super::ply_format::write_comments;
use super::scene_file::SceneFile;
use super::trained_with::TrainedWith;
use crate::scene::{Gaussians, Lobes, Scene};
use crate::{Error, Result};

const NORMALS: [&str; 3] = ["nx", "ny", "nz"];
/// Prefix of header lines that other readers may ignore.
const ANNOUNCED: &str = "comment glint ";

/// Writes a valid scene. Other viewers show the file's `shown`; [`super::read_scene`] returns the scene,
/// whose base starts with the same Gaussians. Both are relative to the scene's origin.
///
/// # Errors
/// [`Error::Usage`] if the base has fewer Gaussians than `shown`, or another SH degree.
pub(super) fn write_file(file: &SceneFile, path: &Path, _: Option<u8>) -> Result<Vec<String>> {
    write(path, file.shown.as_ref(), &file.scene, &file.trained_with)?;
    Ok(Vec::new())
}

pub(super) fn write(path: &Path, shown: Option<&Gaussians>, scene: &Scene, trained_with: &TrainedWith) -> Result<()> {
    let constant;
    let (mut original, mut bands) = (shown.unwrap_or(&scene.base), None);
    if original.len() > scene.base.len() || original.sh_degree != scene.base.sh_degree {
        let what = "this scene cannot be written: it does not begin with the Gaussians of the original";
        return Err(Error::Usage(format!("{}: {what}", path.display())));
    }
    let banded;
    if scene.mixed && shown.is_none() {
        (constant, banded) = parts_of(&scene.base);
        original = &constant;
        bands = (!banded.is_empty()).then(|| Rows::of(&banded, None, Place::is_rest));
    }
    let vertex = Rows::whole(original, None);
    let learned = shown.and_then(|shown| Rows::changed(shown, &scene.base));
    let supplement = scene.supplement.as_ref().map(|s| Rows::whole(&s.gaussians, Some(&s.lobes)));
    let elements = [(BASE, Some(vertex)), (BANDS, bands), (SUPPLEMENT, supplement), (LEARNED, learned)];
    write_whole(path, |file| {
        begin(file, scene.origin, trained_with)?;
        for (name, rows) in &elements {
            rows.iter().try_for_each(|rows| rows.write_header(file, name, rows.gaussians.len()))?;
        }
        writeln!(file, "end_header")?;
        elements.iter().filter_map(|(_, rows)| rows.as_ref()).try_for_each(|rows| rows.write(file))
    })
}

/// Writes a header up to its elements.
pub(super) fn begin(file: &mut impl Write, origin: DVec3, trained_with: &TrainedWith) -> std::io::Result<()> {
    writeln!(file, "ply\nformat binary_little_endian 1.0")?;
    write_comments(file, origin, trained_with)
}

/// Bytes per Gaussian of the base, or of the supplement if `lobed`, in the file of [`super::write_scene`];
/// its header has 2 KB.
pub fn gaussian_bytes(sh_degree: u32, lobed: bool) -> u64 {
    let normals = if has_normals(sh_degree, lobed) { NORMALS.len() as u64 } else { 0 };
    4 * (columns(sh_degree, lobed).len() as u64 + normals)
}

/// Whether Gaussians have normals in a file, all 0. The reference trainer writes them, and some readers expect its layout of harmonics.
fn has_normals(sh_degree: u32, lobed: bool) -> bool {
    sh_degree > 0 && !lobed
}

/// Bytes of the bands of a Gaussian of a [mixed](Scene::mixed) scene.
pub fn band_bytes(sh_degree: u32) -> u64 {
    4 * columns(sh_degree, false).iter().filter(|(_, place)| place.is_rest()).count() as u64
}

/// The base with constant colors, and its Gaussians with bands.
fn parts_of(base: &Gaussians) -> (Gaussians, Gaussians) {
    let banded: Vec<usize> = (base.constants()..base.len()).collect();
    (base.clone().with_degree(0), base.reordered(&banded))
}

/// Size of the file of [`super::write_scene`] in bytes, without its header.
pub fn scene_bytes(scene: &Scene) -> u64 {
    let of = |part: &Gaussians, lobed| part.len() as u64 * gaussian_bytes(part.sh_degree, lobed);
    let base = match scene.mixed {
        true => {
            let banded = scene.base.len() - scene.base.constants();
            scene.base.len() as u64 * gaussian_bytes(0, false) + banded as u64 * band_bytes(scene.base.sh_degree)
        }
        false => of(&scene.base, false),
    };
    base + scene.supplement.as_ref().map_or(0, |supplement| of(&supplement.gaussians, true))
}

/// An element to write.
pub(super) struct Rows<'a> {
    gaussians: &'a Gaussians,
    lobes: &'a Lobes,
    /// Columns; one without a place is 0.
    columns: Vec<(String, Option<Place>)>,
}

impl<'a> Rows<'a> {
    pub(super) fn whole(gaussians: &'a Gaussians, lobes: Option<&'a Lobes>) -> Self {
        let mut rows = Rows::of(gaussians, lobes, |_| true);
        if has_normals(gaussians.sh_degree, lobes.is_some()) {
            rows.columns.splice(3..3, NORMALS.map(|name| (name.into(), None)));
        }
        rows
    }

    /// The columns of `now` that differ from `before`; `None` if there are none.
    fn changed(before: &Gaussians, now: &'a Gaussians) -> Option<Self> {
        let bits = |g: &Gaussians, i: usize, place: Place| number(g, &NO_LOBES, i, place).to_bits();
        let (kept, all) = (before.len(), now.len());
        let differs = |place: Place| (0..kept).any(|i| bits(before, i, place) != bits(now, i, place));
        let rest = columns(now.sh_degree, false)
            .iter()
            .any(|&(_, place)| place.is_rest() && (differs(place) || (kept..all).any(|i| bits(now, i, place) != 0)));
        let rows = Rows::of(now, None, |place| if place.is_rest() { rest } else { all > kept || differs(place) });
        (!rows.columns.is_empty()).then_some(rows)
    }

    /// The columns of `which`.
    pub(super) fn of(gaussians: &'a Gaussians, lobes: Option<&'a Lobes>, which: impl Fn(Place) -> bool) -> Self {
        let all = columns(gaussians.sh_degree, lobes.is_some()).into_iter();
        let columns = all.filter(|(_, place)| which(*place)).map(|(name, place)| (name, Some(place))).collect();
        Rows { gaussians, lobes: lobes.unwrap_or(&NO_LOBES), columns }
    }

    pub(super) fn write_header(&self, file: &mut impl Write, name: &str, count: usize) -> std::io::Result<()> {
        let prefix = if name == BASE { "" } else { ANNOUNCED };
        writeln!(file, "{prefix}element {name} {count}")?;
        self.columns.iter().try_for_each(|(name, _)| writeln!(file, "{prefix}property float {name}"))
    }

    pub(super) fn write(&self, file: &mut impl Write) -> std::io::Result<()> {
        let mut bytes: Vec<u8> = Vec::new();
        for i in 0..self.gaussians.len() {
            let value = |place: Option<Place>| place.map_or(0.0, |place| *number(self.gaussians, self.lobes, i, place));
            bytes.clear();
            bytes.extend(self.columns.iter().flat_map(|(_, place)| value(*place).to_le_bytes()));
            file.write_all(&bytes)?;
        }
        Ok(())
    }
}

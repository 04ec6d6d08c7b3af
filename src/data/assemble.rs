//! Assembles the listed photos of a dataset: finds their files, splits them into training and testing, sets
//! up their lenses, and collects notes for the user.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::images;
use super::left_out::{LeftOut, counted};
use super::lens::{Distortion, Frame, Lens};
use super::listing::{Entry, Focal, Listing};
use super::photo::{Alpha, Dataset, DatasetKind, DatasetOptions, Holdout, ImageFile, Photo, PixelSource, Split};
use super::sector::{Stand, sector};
use super::{names, transforms};
use crate::scene::Camera;
use crate::{Error, Result};

/// Without lists, the first photo by name and every 8th after it are for testing (Mip-NeRF 360, 3DGS).
const TEST_EVERY: u32 = 8;
/// A note reports a photo if more than this fraction of it is outside of its file.
const TOLD_OUTSIDE: f64 = 0.01;

/// `kind` is [`DatasetKind::Transforms`] also for datasets that may turn out to be NeRF Synthetic.
pub(super) fn assemble(kind: DatasetKind, listed: Listing, options: &DatasetOptions) -> Result<Dataset> {
    let Listing { mut entries, points, sources, mut notes } = listed;
    one_split_each(&mut entries, &mut notes);
    let mut seen = HashSet::new();
    for entry in &mut entries {
        entry.name = names::clean(&entry.name);
        if entry.name.is_empty() || !seen.insert(entry.name.clone()) {
            let what = format!("the image name `{}` is empty or appears twice", entry.name);
            return Err(Error::input(&entry.listed_in, what));
        }
    }
    entries.sort_by(|a, b| a.name.cmp(&b.name));
    split(&mut entries, options.holdout);
    if options.tune {
        tune(&mut entries);
    }
    let entries = present(entries, &mut notes)?;
    // NeRF Synthetic gives angles as focal lengths, and lists photos in separate files for training and
    // testing.
    let blender = sources.first().is_some_and(|path| path.ends_with(transforms::TRAIN))
        && entries.iter().all(|entry| matches!(entry.camera.focal, Focal::Angles { .. }));
    let masked = entries.iter().filter(|entry| entry.mask.is_some()).count();
    if masked > 0 {
        let what = "with a mask, whose black pixels do not count";
        notes.push(format!("{} of {} {what}", counted(masked, "photo"), entries.len()));
    }

    let results: Vec<Result<Prepared>> = entries.into_par_iter().map(|entry| prepare(entry, options)).collect();
    // Collected first, so that the error names the first of several faulty photos.
    let prepared = results.into_iter().collect::<Result<Vec<_>>>()?;
    let transparent = prepared.iter().filter(|photo| photo.has_alpha).count();
    tell(&prepared, &mut notes);
    let outside = prepared.iter().fold(0.0, |worst: f64, photo| worst.max(photo.outside));
    let photos: Vec<Photo> = prepared.into_iter().flat_map(|prepared| prepared.photos).collect();
    let mut names = HashSet::new();
    if let Some(double) = photos.iter().find(|photo| !names.insert(&photo.name)) {
        let what = format!("the image name `{}` is that of a panorama's face as well", double.name);
        return Err(Error::Usage(what));
    }
    let lens = |photo: &Photo| matches!(&photo.pixels, PixelSource::File(file) if file.lens.is_some());
    let undistorted = photos.iter().any(lens);
    let background = options.background;
    let mut dataset =
        Dataset { kind, photos, points, background, undistorted, outside, sources, notes, ..Dataset::default() };
    if blender && dataset.surrounds_the_blender_cube() {
        dataset.kind = DatasetKind::Blender;
    } else if blender && dataset.points.is_none() {
        let what =
            "the cameras do not stand around the cube of NeRF Synthetic scenes: random points lie where they look";
        dataset.notes.push(what.into());
    }
    if transparent > 0 && dataset.kind != DatasetKind::Blender && options.alpha == Alpha::Background {
        let what =
            "an alpha channel, through which the background shines; it can be taken for a mask instead (--alpha mask)";
        dataset.notes.push(format!("{} with {what}", counted(transparent, "photo")));
    }
    Ok(dataset)
}

/// A photo in both splits is used for testing only: training must not see it.
fn one_split_each(entries: &mut Vec<Entry>, notes: &mut Vec<String>) {
    let tests: HashSet<PathBuf> = entries
        .iter()
        .filter(|entry| entry.split == Some(Split::Test))
        .filter_map(|entry| entry.path.clone())
        .collect();
    let before = entries.len();
    let trains = |entry: &Entry| entry.split == Some(Split::Train);
    entries.retain(|entry| !(trains(entry) && entry.path.as_ref().is_some_and(|path| tests.contains(path))));
    if entries.len() < before {
        let both = counted(before - entries.len(), "photo");
        notes.push(format!("{both} for training and for testing: used for testing only"));
    }
}

/// Splits photos that are sorted by name. Missing photos keep their place in the order, so that they do not
/// move others to another split.
fn split(entries: &mut [Entry], holdout: Holdout) {
    let test = |is_test: bool| if is_test { Split::Test } else { Split::Train };
    let every = |n: u32, i: usize| test(i.is_multiple_of(n as usize));
    let stand = |entry: &Entry| {
        let back = entry.rotation.transpose();
        Stand { eye: -(back * entry.translation), axis: back.z_axis }
    };
    let stands = || entries.iter().filter(|entry| entry.lost.is_none()).map(stand).collect::<Vec<_>>();
    let mut sector = if holdout == Holdout::Sector { sector(&stands()) } else { vec![] }.into_iter();
    for (i, entry) in entries.iter_mut().enumerate() {
        entry.split = Some(match holdout {
            Holdout::Dataset => entry.split.unwrap_or(every(TEST_EVERY, i)),
            Holdout::Every(n) => every(n, i),
            // A photo without a pose is left out later.
            Holdout::Sector => test(entry.lost.is_none() && sector.next() == Some(true)),
            Holdout::Nothing => Split::Train,
        });
    }
}

/// Leaves out the test photos and tests on some of the others.
fn tune(entries: &mut Vec<Entry>) {
    entries.retain(|entry| entry.split != Some(Split::Test));
    entries.iter_mut().step_by(TEST_EVERY as usize).for_each(|entry| entry.split = Some(Split::Test));
}

/// Keeps the photos that have a pose and a file, with notes for the others.
///
/// # Errors
/// If none is left, or if two have the same file.
fn present(mut entries: Vec<Entry>, notes: &mut Vec<String>) -> Result<Vec<Entry>> {
    // A file that one photo names exactly is not also another's under another spelling.
    let exact: HashSet<PathBuf> =
        entries.iter().filter(|entry| !entry.respelled).filter_map(|entry| entry.path.clone()).collect();
    for entry in entries.iter_mut().filter(|entry| entry.respelled) {
        entry.path = entry.path.take().filter(|path| !exact.contains(path));
    }
    let all = entries.len();
    let (mut lost, mut missing) = (LeftOut::default(), LeftOut::default());
    let listed_in = entries.first().map(|entry| entry.listed_in.clone()).unwrap_or_default();
    entries.retain(|Entry { name, path, expected, lost: pose, .. }| {
        let quoted = || format!("`{name}`");
        match pose {
            Some(why) => lost.add(quoted, || format!("`{name}` has no usable camera: {why}")),
            None if path.is_none() => missing.add(quoted, || {
                let error = expected.try_exists().err();
                let why = error.map_or("is missing".into(), |error| format!("cannot be looked at: {error}"));
                format!("image `{name}` is listed, but {} {why}", expected.display())
            }),
            None => return true,
        }
        false
    });
    if entries.is_empty() && missing.count > 0 {
        let what = format!("{}; --images names the folder of the photos", missing.text());
        return Err(Error::input(listed_in, what));
    }
    if all > 0 && entries.is_empty() {
        return Err(Error::input(listed_in, format!("no photo is left: {}", lost.text())));
    }
    notes.extend([lost.note(all, "photo"), missing.note(all, "photo")].into_iter().flatten());
    let mut owners = HashMap::new();
    for Entry { name, path, listed_in, .. } in &entries {
        if let Some(other) = owners.insert(path, name) {
            let path = path.as_deref().unwrap_or(Path::new("")).display();
            let what = format!("`{other}` and `{name}` are both the one file {path}; expected a file for each camera");
            return Err(Error::input(listed_in, what));
        }
    }
    let respelled = entries.iter().filter(|entry| entry.respelled).count();
    if respelled > 0 {
        let what = "found under another spelling, case, ending or folder of the name";
        notes.push(format!("{} {what}", counted(respelled, "photo")));
    }
    Ok(entries)
}

/// A file's photos: one, or the faces of a panorama.
struct Prepared {
    photos: Vec<Photo>,
    /// Fraction of the picture outside of the file.
    outside: f64,
    /// Principal point and size of the file, if the point is outside of the picture.
    off: Option<([f64; 2], [u32; 2])>,
    has_alpha: bool,
    /// See [`ImageFile::orientation`].
    orientation: u8,
    ends_early: bool,
    distortion: Distortion,
}

/// Intrinsics for a file of this size, and its EXIF orientation. The orientation is 1 unless only the rotated
/// picture fits the camera.
fn turned(entry: &Entry, path: &Path, size: [u32; 2]) -> Result<(Frame, u8), String> {
    let stored = entry.camera.for_image(size);
    if stored.is_ok() && !entry.camera.seems_turned(size) {
        return stored.map(|frame| (frame, 1));
    }
    let tag = images::orientation(path);
    let upright = images::upright(size, tag);
    match entry.camera.for_image(upright) {
        Ok(frame) if upright != size => Ok((frame, tag)),
        _ => stored.map(|frame| (frame, 1)).map_err(|what| {
            let [w, h] = upright;
            if tag == 1 { what } else { format!("{what}; its EXIF orientation, {tag}, makes it {w} × {h}") }
        }),
    }
}

fn prepare(entry: Entry, options: &DatasetOptions) -> Result<Prepared> {
    // Missing photos were removed before.
    let path = entry.path.as_ref().unwrap_or(&entry.expected).clone();
    let images::Header { size, bytes_per_pixel, has_alpha, ends_early } = images::open(&path)?;
    let fail = |what: String| Error::input(&path, format!("{what} (listed in {})", entry.listed_in.display()));
    let (frame, orientation) = turned(&entry, &path, size).map_err(fail)?;
    let size = images::upright(size, orientation);
    let numbers = [frame.fx, frame.fy, frame.cx, frame.cy].into_iter().chain(entry.translation.to_array());
    // The device uses float32.
    // guard: cameras within float32
    if !numbers.clone().all(|v| (v as f32).is_finite()) || !numbers.take(2).all(|v| (v as f32).is_normal()) {
        return Err(fail("its camera's numbers are too large or too small for 32 bits".into()));
    }
    let distortion = entry.camera.distortion;
    let lenses = match distortion {
        Distortion::Equirectangular => {
            let stem = names::without_ending(&entry.name);
            let named = |face: &str| format!("{stem}-{face}{}", &entry.name[stem.len()..]);
            Lens::cube(frame).map(|(face, lens)| (named(face), lens)).to_vec()
        }
        _ => vec![(entry.name.clone(), Lens::new(frame, distortion))],
    };
    let outside = lenses.iter().fold(0.0, |worst: f64, (_, lens)| match distortion.is_none() {
        true => worst,
        false => worst.max(lens.outside_fraction()),
    });
    let split = entry.split.unwrap_or(Split::Train);
    let photos = lenses.into_iter().map(|(name, lens)| {
        let Frame { width, height, fx, fy, cx, cy } = lens.view;
        // From world axes to the file's axes to the view's axes.
        let back = lens.turn.transpose();
        let (rotation, translation) = (back * entry.rotation, back * entry.translation);
        let full = Camera { width, height, fx, fy, cx, cy, rotation, translation };
        let [width, height] = images::fit([width, height], options.max_size);
        let lens = (!distortion.is_none()).then_some(lens);
        let (path, mask, alpha, reduce) = (path.clone(), entry.mask.clone(), options.alpha, options.reduce);
        let file = ImageFile { path, size, orientation, bytes_per_pixel, has_alpha, lens, mask, alpha, reduce };
        Photo { name, camera: full.resized(width, height), split, pixels: PixelSource::File(Box::new(file)) }
    });
    let inside = (0.0..=frame.width as f64).contains(&frame.cx) && (0.0..=frame.height as f64).contains(&frame.cy);
    let off = (!inside).then_some(([frame.cx, frame.cy], size));
    Ok(Prepared { photos: photos.collect(), outside, off, has_alpha, orientation, ends_early, distortion })
}

fn tell(prepared: &[Prepared], notes: &mut Vec<String>) {
    let turned = prepared.iter().filter(|p| p.orientation != 1).count();
    if turned > 0 {
        notes.push(format!(
            "{} turned by the EXIF orientation, as the cameras' sizes ask for",
            counted(turned, "photo")
        ));
    }
    let mut cut = LeftOut::default();
    for name in prepared.iter().filter(|p| p.ends_early).filter_map(|p| Some(&p.photos.first()?.name)) {
        cut.add(|| format!("`{name}`"), || format!("`{name}`"));
    }
    if cut.count > 0 {
        let n = counted(cut.count, "JPEG photo");
        notes.push(format!("{n} without an end, whose missing rows do not count: {}", cut.text()));
    }
    let spheres = prepared.iter().filter(|p| p.distortion == Distortion::Equirectangular).count();
    if spheres > 0 {
        notes.push(format!("{} of the whole sphere: each becomes the six faces of a cube", counted(spheres, "photo")));
    }
    let fisheye = prepared.iter().filter(|p| p.distortion.is_fisheye()).flat_map(|p| p.photos.first());
    if let Some(first) = fisheye.clone().next() {
        let Camera { width, fx, .. } = first.camera;
        let across = 2.0 * (0.5 * f64::from(width) / fx).atan().to_degrees();
        let n = counted(fisheye.count(), "fisheye photo");
        notes.push(format!(
            "{n}: of each a pinhole view with the same focal length is used, {across:.0}° across; what is beyond is not"
        ));
    }
    let smeared: Vec<f64> = prepared.iter().map(|p| p.outside).filter(|&outside| outside > TOLD_OUTSIDE).collect();
    if let Some(worst) = smeared.iter().copied().reduce(f64::max) {
        notes.push(format!(
            "{}: up to {:.0} % of the undistorted picture is beyond the file's edge and does not count",
            counted(smeared.len(), "photo"),
            100.0 * worst
        ));
    }
    let off: Vec<_> = prepared.iter().filter_map(|p| Some((&p.photos.first()?.name, p.off?))).collect();
    if let [(name, ([cx, cy], [width, height])), ..] = off[..] {
        notes.push(format!(
            "{}: the principal point is outside of the picture, ({cx}, {cy}) in `{name}` of {width} × {height}; is this a crop?",
            counted(off.len(), "photo")
        ));
    }
}

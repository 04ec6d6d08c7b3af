//! transforms.json: NeRF Synthetic (Blender), instant-ngp and nerfstudio.
//!
//! Poses are camera-to-world in OpenGL axes (x right, y up, z backward).

use std::borrow::Cow;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use serde::Deserialize;
use serde_json::Value;

use super::left_out::{LeftOut, counted};
use super::lens::{Distortion, Polynomial};
use super::listing::{Entry, Focal, Listing, SourceCamera, unused_masks};
use super::names::{self, Finder, tails};
use super::photo::{DatasetOptions, Holdout, Split};
use super::splits::Lists;
use super::{colmap, folders, points};
use crate::{Error, Result};

pub(super) const TRAIN: &str = "transforms_train.json";
const TEST: &str = "transforms_test.json";
const VALIDATION: &str = "transforms_val.json";
const PLAIN: &str = "transforms.json";
/// Point clouds that nerfstudio and 3DGS write next to such a file, in the frame of its cameras.
const CLOUDS: [&str; 2] = ["sparse_pc.ply", "points3D.ply"];

/// Maximum entry of the difference between RᵀR and a multiple of the identity. Matrices written in float32
/// differ by 1e-6, those with six digits by 1e-5; an error of 1e-3 radian moves a picture with a focal length
/// of 1000 by a pixel.
const MAX_SKEW: f64 = 1e-3;

#[derive(Deserialize)]
struct File {
    #[serde(flatten)]
    camera: Camera,
    frames: Vec<Frame>,
    ply_file_path: Option<String>,
    train_filenames: Option<Vec<String>>,
    val_filenames: Option<Vec<String>>,
    test_filenames: Option<Vec<String>>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    mask_path: Option<String>,
    /// Rows of numbers; if a tracker lost the frame, it may be anything else.
    #[serde(default)]
    transform_matrix: Value,
    #[serde(flatten)]
    camera: Camera,
}

/// A number; NaN for Python's tokens that JSON does not have, see [`quoted`].
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "Value")]
struct Number(f64);

impl TryFrom<Value> for Number {
    type Error = &'static str;

    fn try_from(value: Value) -> Result<Number, &'static str> {
        let number = value.as_str().map_or(value.as_f64(), |word| word.parse().ok());
        number.map(Number).ok_or("expected a number")
    }
}

/// Camera parameters, common to all frames or in one frame, which then wins.
#[derive(Deserialize)]
struct Camera {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    camera_angle_x: Option<Number>,
    camera_angle_y: Option<Number>,
    fl_x: Option<Number>,
    fl_y: Option<Number>,
    cx: Option<Number>,
    cy: Option<Number>,
    w: Option<Number>,
    h: Option<Number>,
    k1: Option<Number>,
    k2: Option<Number>,
    k3: Option<Number>,
    k4: Option<Number>,
    k5: Option<Number>,
    k6: Option<Number>,
    p1: Option<Number>,
    p2: Option<Number>,
}

/// The transforms file of a folder, if it has one; the training file first.
pub(super) fn find(folder: &Path) -> Option<PathBuf> {
    [TRAIN, PLAIN].into_iter().map(|name| folder.join(name)).find(|path| path.is_file())
}

/// Reads `path`. In a folder, transforms_train.json is joined by transforms_test.json; a file that the user
/// named is read alone.
pub(super) fn read(path: &Path, named_itself: bool, options: &DatasetOptions) -> Result<Listing> {
    let test = path.with_file_name(TEST);
    let in_folder = !named_itself && path.file_name().is_some_and(|name| name == TRAIN);
    let both = in_folder && test.is_file();
    let (mut all, cloud) = read_file(path, both.then_some(Split::Train), options)?;
    if both {
        let (test, _) = read_file(&test, Some(Split::Test), options)?;
        all.entries.extend(test.entries);
        all.sources.extend(test.sources);
        // Both files may give the same notes.
        all.notes.extend(test.notes);
        all.notes.dedup();
    }
    add_points(path, cloud.as_deref(), &mut all)?;
    let others = [VALIDATION, PLAIN].into_iter().filter(|name| in_folder && path.with_file_name(name).is_file());
    all.notes.extend(others.map(|name| format!("{name} is not used")));
    Ok(all)
}

/// Reads the photos of a file, and its `ply_file_path`.
fn read_file(path: &Path, split: Option<Split>, options: &DatasetOptions) -> Result<(Listing, Option<String>)> {
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    let file = parse(&bytes, path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let asked = options.images.as_ref().map(|images| folders::asked_folder(folder, images)).transpose()?;
    let finder = Finder::new(folder);
    let found = find_photos(&file, path, &finder, asked.as_deref())?;
    let masks = folders::masks(asked.as_deref().unwrap_or(&folder.join("images")));
    let mut entries = Vec::with_capacity(file.frames.len());
    let (mut with_mask, mut no_mask) = (0, LeftOut::default());
    for (i, (frame, (found, expected))) in file.frames.iter().zip(found).enumerate() {
        let ((camera, pose), lost) = match file.camera_of(frame) {
            Ok(camera) => (camera, None),
            Err(why) => ((NO_CAMERA, (DMat3::IDENTITY, DVec3::ZERO)), Some(format!("frame {i}: {why}"))),
        };
        let named = frame.mask_path.as_ref().filter(|mask| lost.is_none() && !mask.is_empty());
        let mask = named.and_then(|mask| find_mask(mask, &finder));
        if let Some(name) = named {
            with_mask += 1;
            if mask.is_none() {
                let photo = || format!("`{}`", frame.file_path);
                no_mask.add(photo, || format!("{} of {} is missing", finder.expected(name).display(), photo()));
            }
        }
        entries.push(Entry {
            name: names::slashes(&frame.file_path),
            expected,
            respelled: found.as_ref().is_some_and(|found| found.1),
            path: found.map(|found| found.0),
            mask,
            listed_in: path.to_owned(),
            camera,
            rotation: pose.0,
            translation: pose.1,
            lost,
            split,
        });
    }
    let mut notes = masks.as_ref().map(|masks| add_masks(&mut entries, masks)).unwrap_or_default();
    notes.extend(unused_masks(masks.is_some() && notes.is_empty(), &entries));
    notes.extend(no_mask.note(with_mask, "mask"));
    let mut listed = Listing { entries, points: None, sources: vec![path.to_owned()], notes };
    let used = |list: Option<Vec<String>>| list.filter(|names| !names.is_empty());
    let (train, validation, test) = (used(file.train_filenames), used(file.val_filenames), used(file.test_filenames));
    if options.holdout == Holdout::Dataset
        && split.is_none()
        && (train.is_some() || validation.is_some() || test.is_some())
    {
        // Without a test list, the validation list stands in for it.
        let names = ["train_filenames", if test.is_some() { "test_filenames" } else { "val_filenames" }];
        Lists { train, test: test.or(validation), from: names.join(" and ") }.apply(&mut listed);
    }
    Ok((listed, file.ply_file_path))
}

/// The file found for a name, with whether it is respelled; and the path where it is expected.
type Looked = (Option<(PathBuf, bool)>, PathBuf);

/// Looks up each frame's photo. `asked` is the folder of `--images`, which holds the photos under the same names.
fn find_photos(file: &File, path: &Path, finder: &Finder, asked: Option<&Path>) -> Result<Vec<Looked>> {
    let names = file.frames.iter().map(|frame| &frame.file_path);
    if let Some(asked) = asked.map(Finder::new) {
        return Ok(names
            .map(|name| {
                let name = names::slashes(name);
                let bare = tails(&name).last().unwrap_or("");
                (tails(&name).find_map(|tail| asked.find(tail)), asked.expected(bare))
            })
            .collect());
    }
    let mut found: Vec<Looked> = names.map(|name| (finder.find_moved(name), finder.expected(name))).collect();
    // If some photos are there, the others are missing, and a file of that name elsewhere is another picture.
    if found.iter().all(|(photo, _)| photo.is_none()) {
        for ((photo, _), (i, frame)) in found.iter_mut().zip(file.frames.iter().enumerate()) {
            let below = finder.find_below(&frame.file_path).map_err(|what| frame.fault(i, path, &what))?;
            *photo = below.map(|path| (path, true));
        }
    }
    Ok(found)
}

/// Finds the file of a `mask_path`, by a tail with a folder too: the bare name may be the photo's.
fn find_mask(name: &str, finder: &Finder) -> Option<PathBuf> {
    let plain = names::slashes(name);
    let moved = || tails(&plain).skip(1).filter(|tail| tail.contains('/')).find_map(|tail| finder.find(tail));
    finder.find(name).or_else(moved).map(|found| found.0)
}

/// Assigns masks by the photos' names, unless several photos share a mask, for which it returns a note.
fn add_masks(entries: &mut [Entry], masks: &Finder) -> Vec<String> {
    let mut owners: HashMap<PathBuf, Vec<usize>> = HashMap::new();
    for (i, entry) in entries.iter().enumerate().filter(|(_, entry)| entry.mask.is_none()) {
        let mask = masks.find_mask_of_tail(&entry.name);
        mask.into_iter().for_each(|mask| owners.entry(mask).or_default().push(i));
    }
    let mut shared: Vec<_> = owners.iter().filter(|(_, owners)| owners.len() > 1).collect();
    shared.sort();
    let note = shared.first().map(|(mask, owners)| {
        let [a, b] = [owners[0], owners[1]].map(|i| &entries[i].name);
        let (count, mask) = (counted(shared.len(), "mask"), mask.display());
        format!("{count} left out, since several photos share the name: {mask} is for `{a}` and `{b}`; expected a folder for each camera")
    });
    for (mask, owners) in owners {
        if let [one] = owners[..] {
            entries[one].mask = Some(mask);
        }
    }
    note.into_iter().collect()
}

/// Reads the points that the file names; else those beside it, with a note.
fn add_points(path: &Path, named: Option<&str>, listed: &mut Listing) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
    if let Some(name) = named {
        let finder = Finder::new(folder);
        if let Some((cloud, _)) = finder.find_moved(name) {
            let points = points::read_points(&cloud, &mut listed.notes)?;
            listed.points = Some(points).filter(|points| !points.positions.is_empty());
            listed.sources.push(cloud);
            return Ok(());
        }
        listed.notes.push(format!("`ply_file_path` is left out: {} is missing", finder.expected(name).display()));
    }
    for (name, cloud) in CLOUDS.map(|name| (name, folder.join(name))) {
        // A trained scene may have this name too.
        if !cloud.is_file() || !points::is_point_cloud(&cloud)? {
            continue;
        }
        match points::read_points(&cloud, &mut listed.notes) {
            Ok(points) if points.positions.is_empty() => {}
            Ok(points) => {
                listed.notes.push(format!("the points of {name} are taken, which {} does not name", file_name(path)));
                listed.points = Some(points);
                listed.sources.push(cloud);
                return Ok(());
            }
            Err(error) => listed.notes.push(format!("the points of {name} are left out: {error}")),
        }
    }
    let Some(model) = folders::find_model(folder, &DatasetOptions::default())? else { return Ok(()) };
    let place = model.folder.strip_prefix(folder).unwrap_or(&model.folder).display().to_string();
    let what = match colmap::points_for(&model.folder, &listed.entries, &mut listed.notes) {
        Ok(Some((points, source))) => {
            listed.points = Some(points);
            listed.sources.push(source);
            "are taken, in the frame of these cameras".into()
        }
        Ok(None) => return Ok(()),
        Err(why) => format!("are left out: {why}"),
    };
    listed.notes.push(format!("the points of the COLMAP model in {place} {what}"));
    Ok(())
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

impl File {
    /// Intrinsics of a frame, and its rotation and translation.
    fn camera_of(&self, frame: &Frame) -> Result<(SourceCamera, (DMat3, DVec3)), String> {
        let pose = pose(&frame.transform_matrix)?;
        Ok((source_camera(&frame.camera, &self.camera)?, pose))
    }
}

/// Placeholder for the intrinsics of a frame that is left out.
const NO_CAMERA: SourceCamera =
    SourceCamera { size: None, focal: Focal::Sphere, center: None, distortion: Distortion::Equirectangular };

impl Frame {
    fn fault(&self, index: usize, path: &Path, what: &str) -> Error {
        Error::input(path, format!("frame {index} (`{}`): {what}", self.file_path))
    }
}

/// Reads `bytes` and checks every frame like [`read`], without looking for images.
pub(super) fn check(bytes: &[u8], path: &Path) -> Result<()> {
    let file = parse(bytes, path)?;
    file.frames
        .iter()
        .enumerate()
        .try_for_each(|(i, frame)| file.camera_of(frame).map(drop).map_err(|what| frame.fault(i, path, &what)))
}

fn parse(bytes: &[u8], path: &Path) -> Result<File> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let parse = |bytes: &[u8]| serde_json::from_slice::<File>(bytes);
    let file = parse(bytes).or_else(|error| match quoted(bytes) {
        Cow::Owned(bytes) => parse(&bytes),
        Cow::Borrowed(_) => Err(error),
    });
    let file = file.map_err(|error| Error::input(path, format!("is not a valid transforms file: {error}")))?;
    if file.frames.is_empty() {
        return Err(Error::input(path, "`frames` is empty"));
    }
    Ok(file)
}

/// Quotes bare `NaN`, `Infinity` and `-Infinity`, which Python writes although JSON has no such words.
fn quoted(bytes: &[u8]) -> Cow<'_, [u8]> {
    const WORDS: [&[u8]; 3] = [b"-Infinity", b"Infinity", b"NaN"];
    let (mut out, mut from, mut at, mut in_string) = (Vec::new(), 0, 0, false);
    while at < bytes.len() {
        match bytes[at] {
            b'\\' if in_string => at += 1,
            b'"' => in_string = !in_string,
            _ if in_string => {}
            _ => {
                if let Some(word) = WORDS.iter().find(|word| bytes[at..].starts_with(word)) {
                    out.extend([&bytes[from..at], b"\"", word, b"\""].concat());
                    from = at + word.len();
                    at = from;
                    continue;
                }
            }
        }
        at += 1;
    }
    if from == 0 {
        return Cow::Borrowed(bytes);
    }
    out.extend(&bytes[from..]);
    Cow::Owned(out)
}

fn source_camera(frame: &Camera, all: &Camera) -> Result<SourceCamera, String> {
    macro_rules! given {
        ($field:ident) => {
            frame.$field.or(all.$field).map(|Number(value)| value)
        };
    }
    let model = frame.camera_model.as_deref().or(all.camera_model.as_deref()).unwrap_or("OPENCV").to_uppercase();
    let fisheye = match &model[..] {
        "OPENCV" if frame.is_fisheye.or(all.is_fisheye) == Some(true) => true,
        "OPENCV_FISHEYE" => true,
        "OPENCV" | "FULL_OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "EQUIRECTANGULAR" => {
            false
        }
        _ => {
            return Err(format!(
                "camera_model {model} is not read; OPENCV, OPENCV_FISHEYE, FULL_OPENCV, EQUIRECTANGULAR are"
            ));
        }
    };
    let pair = |a: Option<f64>, b: Option<f64>, names: &str| match (a, b) {
        (Some(a), Some(b)) => Ok(Some([a, b])),
        (None, None) => Ok(None),
        _ => Err(format!("has only one of {names}")),
    };
    let size = pair(given!(w), given!(h), "`w` and `h`")?;
    if model == "EQUIRECTANGULAR" {
        // A sphere ignores focal length and principal point.
        let camera = SourceCamera { size, focal: Focal::Sphere, center: None, distortion: Distortion::Equirectangular };
        return camera.check().map(|()| camera);
    }
    let focal = match (given!(fl_x), given!(camera_angle_x)) {
        (Some(x), _) => Focal::Pixels([x, given!(fl_y).unwrap_or(x)]),
        (None, Some(x)) => Focal::Angles { x, y: given!(camera_angle_y) },
        (None, None) => return Err("has neither `fl_x` nor `camera_angle_x`".into()),
    };
    let k = [given!(k1), given!(k2), given!(k3), given!(k4), given!(k5), given!(k6)].map(|k| k.unwrap_or(0.0));
    let tangential = [given!(p1), given!(p2)].map(|p| p.unwrap_or(0.0));
    let [k1, k2, k3, k4, k5, k6] = k;
    let plain = Polynomial { tangential, ..Default::default() };
    let distortion = Distortion::Polynomial(if fisheye {
        Polynomial { fisheye, radial: [k1, k2, k3, k4, 0.0, 0.0], ..Default::default() }
    } else if model == "FULL_OPENCV" || k5 != 0.0 || k6 != 0.0 {
        // OpenCV divides by the terms from k4 on.
        Polynomial { radial: [k1, k2, k3, 0.0, 0.0, 0.0], divisor: [k4, k5, k6], ..plain }
    } else {
        // nerfstudio, the source of this format, uses k4 for one more power.
        Polynomial { radial: [k1, k2, k3, k4, 0.0, 0.0], ..plain }
    });
    let camera = SourceCamera { size, focal, center: pair(given!(cx), given!(cy), "`cx` and `cy`")?, distortion };
    camera.check()?;
    Ok(camera)
}

/// World-to-camera rotation and translation in OpenCV axes, from a camera-to-world matrix in OpenGL axes. A
/// uniform scale of the rotation part (a scaled camera object in Blender) changes no ray and is removed; skew
/// and mirroring are errors.
fn pose(matrix: &Value) -> Result<(DMat3, DVec3), String> {
    if matrix.is_null() {
        return Err("there is no `transform_matrix`".into());
    }
    // Anything except a number counts as NaN.
    let numbers = |row: &Value| -> Vec<f64> {
        row.as_array().into_iter().flatten().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect()
    };
    let rows: Vec<Vec<f64>> = matrix.as_array().into_iter().flatten().map(numbers).collect();
    if !(rows.len() == 3 || rows.len() == 4) || rows.iter().any(|row| row.len() != 4) {
        return Err("`transform_matrix` is not 4 × 4 (or 3 × 4)".into());
    }
    // guard: transforms: numbers
    if rows.iter().flatten().any(|v| !v.is_finite()) {
        return Err("`transform_matrix` holds a number that is not finite".into());
    }
    if let Some(last) = rows.get(3)
        && last.iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(v, expected)| (v - expected).abs() > 1e-6)
    {
        return Err(format!("the last row of `transform_matrix` is {last:?}, expected [0, 0, 0, 1]"));
    }
    let column = |j: usize| DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    let mut turn = DMat3::from_cols(column(0), column(1), column(2));
    let scale = turn.determinant().cbrt();
    if !scale.is_normal() || scale < 0.0 {
        return Err(format!("the rotation of `transform_matrix` has determinant {:e}, expected 1", turn.determinant()));
    }
    turn *= 1.0 / scale;
    let skew = turn.transpose() * turn - DMat3::IDENTITY;
    let skew = skew.to_cols_array().map(f64::abs);
    // guard: transforms: rotations
    if !skew.iter().all(|v| *v <= MAX_SKEW) {
        let worst = skew.iter().copied().fold(0.0, f64::max);
        return Err(format!(
            "the rotation of `transform_matrix` is not one: RᵀR is off by {worst:.1e}, {MAX_SKEW:.0e} is allowed"
        ));
    }
    // Newton's iteration to the nearest rotation squares the error, so twice is enough from 1e-3.
    for _ in 0..2 {
        turn = (turn + turn.transpose().inverse()) * 0.5;
    }
    let eye = column(3);
    let rotation = DMat3::from_cols(turn.x_axis, -turn.y_axis, -turn.z_axis).transpose();
    Ok((rotation, -(rotation * eye)))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A camera at (1, 2, 3) turned about x by a right angle: it looks along world +y with +z up.
    const UPRIGHT: [[f64; 4]; 4] =
        [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, -1.0, 2.0], [0.0, 1.0, 0.0, 3.0], [0.0, 0.0, 0.0, 1.0]];

    fn pose(matrix: &[[f64; 4]]) -> Result<(DMat3, DVec3), String> {
        super::pose(&json!(matrix))
    }

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, contents) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, contents).unwrap();
        }
        folder
    }

    /// Reads a transforms.json with the members `all`, and one frame with the members `frame`.
    fn one(all: Value, frame: Value) -> Result<Entry> {
        let mut file = json!({"frames": [{"file_path": "a.png", "transform_matrix": UPRIGHT}]});
        let merge = |into: &mut Value, from: &Value| {
            let (Value::Object(into), Value::Object(from)) = (into, from) else { panic!("not objects") };
            into.extend(from.clone());
        };
        merge(&mut file, &all);
        merge(&mut file["frames"][0], &frame);
        let folder = folder(&[(PLAIN, &file.to_string()), ("a.png", ""), ("b.jpeg", "")]);
        Ok(listed(&folder)?.entries.remove(0))
    }

    fn listed(folder: &tempfile::TempDir) -> Result<Listing> {
        read(&find(folder.path()).unwrap(), false, &DatasetOptions::default())
    }

    /// Checks the reason why the frame is left out.
    #[track_caller]
    fn expect(all: Value, frame: Value, parts: &[&str]) {
        let why = one(all, frame).unwrap().lost.unwrap();
        for part in parts.iter().chain(&["frame 0: "]) {
            assert!(why.contains(part), "`{part}` is not in: {why}");
        }
    }

    #[test]
    fn a_uniform_scale_changes_nothing_and_small_errors_are_taken_out() {
        let exact = pose(&UPRIGHT).unwrap();
        assert_eq!(pose(&UPRIGHT[..3]).unwrap(), exact);
        for scale in [1e-3, 0.5, 40.0] {
            let mut scaled = UPRIGHT;
            scaled[..3].iter_mut().for_each(|row| row[..3].iter_mut().for_each(|v| *v *= scale));
            let (rotation, translation) = pose(&scaled).unwrap();
            assert!((rotation - exact.0).to_cols_array().iter().all(|v| v.abs() < 1e-12));
            assert!((translation - exact.1).length() < 1e-12);
        }
        let mut skewed = UPRIGHT;
        skewed[0][1] = 9e-4;
        let (rotation, _) = pose(&skewed).unwrap();
        let gram = rotation.transpose() * rotation - DMat3::IDENTITY;
        assert!(gram.to_cols_array().iter().all(|v| v.abs() < 1e-12));
    }

    #[test]
    fn bad_matrices_are_left_out_by_frame() {
        let expect_lost = |frame: Value, part: &str| expect(json!({"camera_angle_x": 0.7}), frame, &[part]);
        let edited = |row: usize, column: usize, value: f64| {
            let mut matrix = UPRIGHT;
            matrix[row][column] = value;
            json!({"transform_matrix": matrix})
        };
        expect_lost(edited(0, 1, 0.01), "RᵀR");
        expect_lost(edited(0, 0, 1.1), "RᵀR");
        expect_lost(edited(0, 0, -1.0), "determinant");
        expect_lost(edited(0, 0, 0.0), "determinant");
        expect_lost(edited(3, 3, 2.0), "last row");
        let matrix = |matrix: Value| json!({"transform_matrix": matrix});
        expect_lost(matrix(json!([[1, 0, 0, 0]])), "4 × 4");
        expect_lost(matrix(json!([[1, 0], [1, 0], [1, 0], [1, 0]])), "4 × 4");
        expect_lost(matrix(json!("lost")), "4 × 4");
        expect_lost(matrix(json!(vec![[0.0; 4]; 4])), "last row");
        expect_lost(matrix(json!(vec![[0.0; 4]; 3])), "determinant");
        expect_lost(matrix(json!(null)), "no `transform_matrix`");
        for none in [json!(null), json!("NaN"), json!("-Infinity")] {
            expect_lost(matrix(json!([[none, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]])), "not finite");
        }
    }

    /// Python writes tokens that JSON does not have.
    #[test]
    fn a_frame_without_a_pose_does_not_refuse_the_others() {
        let read = |first: &str| {
            let frame = |name: &str, matrix: &str| format!(r#"{{"file_path": "{name}.png"{matrix}}}"#);
            let matrix = format!(r#", "transform_matrix": {}"#, json!(UPRIGHT));
            let frames = [frame("a", first), frame("NaN, \\\" -Infinity", &matrix)].join(",");
            let text = format!(r#"{{"fl_x": 9, "frames": [{frames}]}}"#);
            listed(&folder(&[(PLAIN, &text), ("a.png", "")]))
        };
        for first in [
            "",
            r#", "transform_matrix": null"#,
            r#", "transform_matrix": NaN"#,
            r#", "transform_matrix": [[-Infinity, Infinity, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]"#,
            r#", "transform_matrix": [[NaN,NaN,NaN,NaN],[NaN,NaN,NaN,NaN],[NaN,NaN,NaN,NaN],[0,0,0,1]]"#,
        ] {
            let entries = read(first).unwrap().entries;
            assert!(entries[0].lost.is_some() && entries[1].lost.is_none(), "{first}");
            assert_eq!(entries[1].name, "NaN, \" -Infinity.png", "names are as they were");
            assert_eq!(entries[1].translation, pose(&UPRIGHT).unwrap().1);
        }
    }

    #[test]
    fn intrinsics_stand_in_the_file_or_in_the_frame_which_counts_first() {
        let all = json!({"fl_x": 100, "fl_y": 90.5, "cx": 30, "cy": 20, "w": 64, "h": 48.0, "k1": 0.1, "k3": 0.01, "p2": 1e-3});
        let camera = one(all.clone(), json!({"fl_x": 110.0, "k1": 0.2})).unwrap().camera;
        let polynomial = |radial: [f64; 6], divisor, tangential| {
            Distortion::Polynomial(Polynomial { radial, divisor, tangential, ..Default::default() })
        };
        let distortion = polynomial([0.2, 0.0, 0.01, 0.0, 0.0, 0.0], [0.0; 3], [0.0, 1e-3]);
        let (size, center) = (Some([64.0, 48.0]), Some([30.0, 20.0]));
        assert_eq!(camera, SourceCamera { size, focal: Focal::Pixels([110.0, 90.5]), center, distortion });
        let camera = one(json!({"fl_x": 100}), json!({})).unwrap().camera;
        let distortion = Distortion::default();
        assert_eq!(camera, SourceCamera { size: None, focal: Focal::Pixels([100.0, 100.0]), center: None, distortion });
        let camera = one(json!({"camera_angle_x": 0.7, "camera_model": "PINHOLE"}), json!({})).unwrap().camera;
        assert_eq!(camera.focal, Focal::Angles { x: 0.7, y: None });
        // Omitted endings are found.
        assert!(one(all, json!({"file_path": "./b"})).unwrap().path.unwrap().ends_with("b.jpeg"));
        let lens = |all: Value| one(all, json!({"fl_x": 100})).unwrap().camera;
        let k = json!({"k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4, "camera_model": "opencv"});
        assert_eq!(lens(k.clone()).distortion, polynomial([0.1, 0.2, 0.3, 0.4, 0.0, 0.0], [0.0; 3], [0.0; 2]));
        let with = |key: &str, value: Value| {
            let mut all = k.clone();
            all[key] = value;
            lens(all).distortion
        };
        let full = [0.1, 0.2, 0.3, 0.0, 0.0, 0.0];
        assert_eq!(with("k5", json!(0.5)), polynomial(full, [0.4, 0.5, 0.0], [0.0; 2]));
        assert_eq!(with("k6", json!(0.6)), polynomial(full, [0.4, 0.0, 0.6], [0.0; 2]));
        assert_eq!(with("camera_model", json!("FULL_OPENCV")), polynomial(full, [0.4, 0.0, 0.0], [0.0; 2]));
        let fisheye = Distortion::fisheye([0.1, 0.2, 0.3, 0.4]);
        assert_eq!([with("camera_model", json!("OpenCV_Fisheye")), with("is_fisheye", json!(true))], [fisheye; 2]);
        let sphere = lens(json!({"camera_model": "EQUIRECTANGULAR", "cx": 1, "w": 64, "h": 32, "k1": 7}));
        let expected = SourceCamera {
            size: Some([64.0, 32.0]),
            focal: Focal::Sphere,
            center: None,
            distortion: Distortion::Equirectangular,
        };
        assert_eq!(sphere, expected);
    }

    #[test]
    fn cameras_that_are_not_read_are_named() {
        let with = |all: Value, parts: &[&str]| expect(all, json!({}), parts);
        with(json!({}), &["fl_x", "camera_angle_x"]);
        with(json!({"fl_x": 1.0, "camera_model": "VR180_L"}), &["VR180_L", "OPENCV_FISHEYE"]);
        with(json!({"fl_x": -1.0}), &["focal lengths"]);
        with(json!({"camera_angle_x": 47}), &["field of view 47"]);
        with(json!({"fl_x": 1.0, "cx": "Infinity", "cy": 2}), &["principal point [inf, 2.0]"]);
        with(json!({"fl_x": 1.0, "w": 64}), &["only one of `w` and `h`"]);
        with(json!({"fl_x": 1.0, "w": 0, "h": 5}), &["size"]);
        // A frame's own value wins, even if it is invalid.
        expect(json!({"fl_x": 1.0}), json!({"fl_x": "NaN"}), &["focal lengths [NaN, NaN]"]);
        let refused = one(json!({"fl_x": "wide"}), json!({})).err().unwrap().to_string();
        assert!(refused.contains("not a valid transforms file: expected a number"), "{refused}");
        assert!(
            parse(b"{\"frames\": []}", Path::new("t.json")).err().unwrap().to_string().contains("`frames` is empty")
        );
        assert!(parse(b"{\"frames\": NaN}", Path::new("t.json")).err().unwrap().to_string().contains("t.json"));
    }

    /// Both files count as read, so neither may be written over.
    #[test]
    fn test_views_come_from_a_file_of_their_own() {
        let frame = json!({"file_path": "r_0", "transform_matrix": UPRIGHT});
        let file = json!({"camera_angle_x": 0.7, "frames": [frame]}).to_string();
        let folder = folder(&[(TRAIN, &file), (TEST, &file.replace("r_0", "r_1"))]);
        let read = || listed(&folder).unwrap();
        assert_eq!(read().sources, [TRAIN, TEST].map(|name| folder.path().join(name)));
        fs::remove_file(folder.path().join(TEST)).unwrap();
        assert_eq!(read().entries[0].split, None);
    }

    #[test]
    fn nerfstudios_lists_say_what_is_for_what() {
        let frames =
            ["a", "b", "c", "d"].map(|n| json!({"file_path": format!("images/{n}.png"), "transform_matrix": UPRIGHT}));
        let read = |lists: Value, holdout| {
            let mut file = json!({"fl_x": 9.0, "frames": frames});
            file.as_object_mut().unwrap().extend(lists.as_object().unwrap().clone());
            let folder = folder(&[(PLAIN, &file.to_string())]);
            let listed =
                super::read(&folder.path().join(PLAIN), false, &DatasetOptions { holdout, ..Default::default() })
                    .unwrap();
            let letter = |split| match split {
                Some(Split::Train) => 'r',
                Some(Split::Test) => 't',
                None => '-',
            };
            (listed.entries.iter().map(|entry| letter(entry.split)).collect::<String>(), listed.notes)
        };
        let name = |n: &str| format!("images/{n}.png");
        let all = json!({
            "train_filenames": [name("a"), name("b")], "val_filenames": [name("c")],
            "test_filenames": [".\\images\\d.png", name("x")],
        });
        let (splits, notes) = read(all.clone(), Holdout::Dataset);
        assert_eq!(splits, "rrt");
        assert!(notes[0].contains("1 photo for testing") && notes[0].contains("test_filenames"), "{notes:?}");
        assert!(notes[1].contains("1 photo left out") && notes[2].contains("`images/x`"), "{notes:?}");
        assert_eq!(read(all, Holdout::Every(2)), ("----".into(), Vec::new()));
        let validation =
            json!({"train_filenames": [name("a"), name("b"), name("c")], "val_filenames": [name("c"), name("d")]});
        let (splits, notes) = read(validation, Holdout::Dataset);
        assert!(splits == "rrtt" && notes[0].contains("val_filenames"), "{splits} {notes:?}");
        assert_eq!(read(json!({"train_filenames": [name("a")], "test_filenames": []}), Holdout::Dataset).0, "rttt");
        assert_eq!(read(json!({"test_filenames": [name("a")]}), Holdout::Dataset).0, "trrr");
        assert_eq!(read(json!({"train_filenames": []}), Holdout::Dataset).0, "----");
    }

    #[test]
    fn points_are_those_that_are_named_else_those_beside() {
        let frame = json!({"file_path": "a.png", "transform_matrix": UPRIGHT});
        let plain = json!({"fl_x": 9.0, "frames": [frame]}).to_string();
        let named = json!({"fl_x": 9.0, "frames": [frame], "ply_file_path": "points.ply"}).to_string();
        let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
        let with = |json: &str, names: &[&str]| {
            let clouds = names.iter().map(|name| (*name, ply));
            let files: Vec<(&str, &str)> = [(PLAIN, json), ("a.png", "")].into_iter().chain(clouds).collect();
            let folder = folder(&files);
            let Listing { points, sources, notes, .. } = listed(&folder).unwrap();
            let last = sources.last().unwrap().strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned();
            (points.map(|p| p.positions), last, notes.join("; "))
        };
        let points = Some(vec![[1.0, 2.0, 3.0]]);
        assert_eq!(with(&plain, &["points.ply"]), (None, PLAIN.into(), String::new()));
        assert_eq!(
            with(&named, &["points.ply", "sparse_pc.ply"]),
            (points.clone(), "points.ply".into(), String::new())
        );
        for beside in CLOUDS {
            let note = format!("the points of {beside} are taken, which transforms.json does not name");
            assert_eq!(with(&plain, &[beside]), (points.clone(), beside.into(), note));
        }
        let (found, last, notes) = with(&named, &["sparse_pc.ply"]);
        assert_eq!((found, &last[..]), (points.clone(), "sparse_pc.ply"));
        assert!(notes.contains("`ply_file_path` is left out") && notes.contains("points.ply is missing"), "{notes}");
        let (found, last, notes) = with(&named, &[]);
        assert!(found.is_none() && last == PLAIN && notes.contains("points.ply is missing"), "{notes}");
        // A scene with that name does not give first points, and a broken file is reported.
        let broken = [
            (PLAIN, &plain[..]),
            ("a.png", ""),
            ("sparse_pc.ply", "ply\nnothing"),
            ("points3D.ply", "ply\nproperty float f_dc_0\nend_header\n"),
        ];
        let folder = folder(&broken);
        let listed = listed(&folder).unwrap();
        assert_eq!((listed.points, listed.notes.len()), (None, 1));
        assert!(listed.notes[0].contains("sparse_pc.ply are left out"), "{:?}", listed.notes);
    }

    #[test]
    fn a_mask_that_several_photos_have_a_name_for_is_none() {
        let frame = |name: &str| json!({"file_path": format!("images/{name}.png"), "transform_matrix": UPRIGHT});
        let frames = ["c0/a", "c1/a", "c0/b", "c1/c"].map(frame);
        let file = json!({"fl_x": 9.0, "frames": frames}).to_string();
        let read = |masks: &[&str]| {
            let files: Vec<(&str, &str)> =
                [(PLAIN, &file[..])].into_iter().chain(masks.iter().map(|mask| (*mask, ""))).collect();
            let folder = folder(&files);
            let listed = listed(&folder).unwrap();
            let name = |entry: &Entry| {
                Some(entry.mask.as_ref()?.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned())
            };
            (listed.entries.iter().map(name).collect::<Vec<_>>(), listed.notes.join("; "))
        };
        let (found, notes) = read(&["masks/a.png", "masks/b.png"]);
        assert_eq!(found, [None, None, Some("masks/b.png".into()), None]);
        assert!(
            notes.contains("1 mask left out")
                && notes.contains("masks/a.png is for `images/c0/a.png` and `images/c1/a.png`"),
            "{notes}"
        );
        let (found, notes) = read(&["masks/c0/a.png", "masks/c1/a.png.png"]);
        assert_eq!(found, [Some("masks/c0/a.png".into()), Some("masks/c1/a.png.png".into()), None, None]);
        assert_eq!(notes, "");
    }
}

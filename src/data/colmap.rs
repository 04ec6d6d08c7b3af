//! COLMAP's sparse models, binary and text (<https://colmap.github.io/format.html>).

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Cursor, ErrorKind, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use glam::{DMat3, DQuat, DVec3};

use super::left_out::LeftOut;
use super::lens::{Distortion, Polynomial};
use super::listing::{Entry, Focal, Listing, SourceCamera, unused_masks};
use super::names::{self, Finder};
use super::photo::{DatasetOptions, Holdout};
use super::ply_format::is_nan_of_windows;
use super::points::{self, PointCloud};
use super::{folders, splits};
use crate::{Error, Result};

/// The images of a model of the dataset in `root`, and its points if there are any.
pub(super) fn read(root: &Path, model: &folders::Model, options: &DatasetOptions) -> Result<Listing> {
    let folder = &model.folder;
    let path = find(folder, "cameras");
    let bytes = bytes_of(&path)?;
    let mut sources = vec![path.clone()];
    let cameras = if is_text(&path) { cameras_text(&bytes, &path) } else { cameras_binary(&bytes, &path) }?;
    let path = find(folder, "images");
    sources.push(path.clone());
    let poses = poses(&path)?;
    if poses.is_empty() {
        return Err(Error::input(path, "the model has no images"));
    }
    let mut notes = Vec::from_iter(model.note(root));
    let photos = model.photos(root, options, &mut notes)?;
    let (masks, finder) = (folders::masks(&photos), Finder::new(photos));
    // If some photos are at the stated places, the others are missing, not moved.
    let moved = poses.iter().all(|pose| finder.find(&pose.name).is_none());
    let mut entries = Vec::with_capacity(poses.len());
    for pose in poses {
        let Some(camera) = cameras.get(&pose.camera).copied() else {
            let what = format!("image `{}`: its camera {} is not in the model", pose.name, pose.camera);
            return Err(Error::input(&path, what));
        };
        let intrinsics = camera.check().map_err(|why| format!("camera {}: {why}", pose.camera));
        let (rotation, lost) = match intrinsics.and_then(|()| pose.rotation()) {
            Ok(turn) => (turn, None),
            Err(why) => (DMat3::IDENTITY, Some(why)),
        };
        let (found, mask) = match moved || names::is_absolute(&pose.name) {
            true => {
                (finder.find_moved(&pose.name), masks.as_ref().and_then(|masks| masks.find_mask_of_tail(&pose.name)))
            }
            false => (finder.find(&pose.name), masks.as_ref().and_then(|masks| masks.find_mask(&pose.name))),
        };
        entries.push(Entry {
            expected: finder.expected(&pose.name),
            respelled: found.as_ref().is_some_and(|found| found.1),
            path: found.map(|found| found.0),
            mask,
            name: names::slashes(&pose.name),
            listed_in: path.clone(),
            camera,
            rotation,
            translation: DVec3::from_array(pose.translation),
            lost,
            split: None,
        });
    }
    notes.extend(unused_masks(masks.is_some(), &entries));
    let points = points(folder, &mut notes)?.map(|(points, source)| {
        sources.push(source);
        points
    });
    let points = points.filter(|points| !points.positions.is_empty());
    let lists = splits::find(&[folder, root], &mut sources)?;
    let mut listed = Listing { entries, points, sources, notes };
    if let (Some(lists), Holdout::Dataset) = (lists, options.holdout) {
        lists.apply(&mut listed);
    }
    Ok(listed)
}

/// Reads the poses of a model's images.
fn poses(path: &Path) -> Result<Vec<Pose>> {
    if is_text(path) { images_text(&bytes_of(path)?, path) } else { images_binary(stream(path)?, path) }
}

/// Reads a model's points, and returns them with their file.
fn points(folder: &Path, notes: &mut Vec<String>) -> Result<Option<(PointCloud, PathBuf)>> {
    let path = find(folder, "points3D");
    let read = match is_text(&path) {
        true => bytes_of(&path).and_then(|bytes| points_text(&bytes, &path, notes)),
        false => stream(&path).and_then(|file| points_binary(file, &path, notes)),
    };
    match read {
        Ok(points) => Ok(Some((points, path))),
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {
            // 3DGS leaves the points in this form too.
            let cloud = folder.join("points3D.ply");
            let points = cloud.is_file().then(|| points::read_points(&cloud, notes)).transpose()?;
            Ok(points.map(|points| (points, cloud)))
        }
        Err(error) => Err(error),
    }
}

/// Rotation from the world and eye of a camera.
type Stand = (DMat3, DVec3);

/// Tolerance between the cameras of a model and those of the photos with the same names: a share of their spread, and an entry of a
/// rotation. It moves a point by a few pixels.
const SAME_PLACE: f64 = 1e-2;

/// Reads the points of a model and moves them into the frame of `entries`, by the similarity between the two sets of cameras. `None` if the
/// model has no points.
///
/// # Errors
/// Says why the points cannot be used.
pub(super) fn points_for(
    folder: &Path,
    entries: &[Entry],
    notes: &mut Vec<String>,
) -> Result<Option<(PointCloud, PathBuf)>, String> {
    let mut found = Vec::new();
    let points = points(folder, &mut found).map_err(|error| error.to_string())?;
    let Some((mut points, source)) = points.filter(|(points, _)| !points.positions.is_empty()) else { return Ok(None) };
    let poses = poses(&find(folder, "images")).map_err(|error| error.to_string())?;
    let by_name: HashMap<String, &Pose> = poses.iter().map(|pose| (names::compared(&pose.name), pose)).collect();
    // Rotation and eye in the model and in the photos' frame.
    let pairs: Vec<(Stand, Stand)> = entries
        .iter()
        .filter(|entry| entry.lost.is_none())
        .filter_map(|entry| {
            let name = names::compared(&entry.name);
            let pose = names::tails(&name).find_map(|tail| by_name.get(tail))?;
            let turn = pose.rotation().ok()?;
            let eye = |turn: DMat3, translation: DVec3| -(turn.transpose() * translation);
            let (here, there) =
                (eye(entry.rotation, entry.translation), eye(turn, DVec3::from_array(pose.translation)));
            Some(((turn, there), (entry.rotation, here)))
        })
        .collect();
    let Some((first, _)) = pairs.split_first() else { return Err("none of its images is one of these photos".into()) };
    let n = pairs.len() as f64;
    let (from, to) = pairs.iter().fold((DVec3::ZERO, DVec3::ZERO), |(a, b), ((_, m), (_, f))| (a + m / n, b + f / n));
    let spread = |which: fn(&(Stand, Stand)) -> DVec3, mean: DVec3| {
        (pairs.iter().map(|pair| (which(pair) - mean).length_squared()).sum::<f64>() / n).sqrt()
    };
    let (wide, wider) = (spread(|pair| pair.0.1, from), spread(|pair| pair.1.1, to));
    let scale = if wide > 0.0 && wider > 0.0 { wider / wide } else { 1.0 };
    let turn = first.1.0.transpose() * first.0.0;
    let there = |p: DVec3| scale * (turn * (p - from)) + to;
    let same = pairs.iter().all(|((model, m), (entry, f))| {
        let off = (entry.transpose() * *model - turn).to_cols_array();
        off.iter().all(|v| v.abs() <= SAME_PLACE) && (there(*m) - *f).length() <= SAME_PLACE * wider
    });
    if !same {
        return Err("its cameras do not stand to each other as these do".into());
    }
    for p in &mut points.positions {
        *p = there(DVec3::from_array(*p)).to_array();
    }
    notes.extend(found);
    Ok(Some((points, source)))
}

/// `stem`.bin if it is there, else `stem`.txt: the two may be mixed.
fn find(model: &Path, stem: &str) -> PathBuf {
    let binary = model.join(format!("{stem}.bin"));
    if binary.exists() { binary } else { model.join(format!("{stem}.txt")) }
}

fn bytes_of(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|source| Error::io(path, source))
}

/// A file of which only a buffer is in memory: observations and tracks of a city take gigabytes.
fn stream(path: &Path) -> Result<BufReader<File>> {
    File::open(path).map(BufReader::new).map_err(|source| Error::io(path, source))
}

fn is_text(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "txt")
}

pub(super) type Cameras = HashMap<u32, SourceCamera>;

pub(super) struct Pose {
    pub(super) name: String,
    /// World to camera, (w, x, y, z).
    quat: [f64; 4],
    translation: [f64; 3],
    camera: u32,
}

impl Pose {
    /// World to camera. Checks the translation too.
    pub(super) fn rotation(&self) -> Result<DMat3, String> {
        let [w, x, y, z] = self.quat;
        let quat = DQuat::from_xyzw(x, y, z, w);
        // Any length but zero means the same rotation.
        // guard: COLMAP: poses
        if !self.quat.iter().chain(&self.translation).all(|v| v.is_finite()) || !quat.length_squared().is_normal() {
            let Pose { quat, translation, .. } = self;
            return Err(format!("{quat:?} {translation:?} is not finite or has no rotation"));
        }
        Ok(DMat3::from_quat(quat.normalize()))
    }
}

/// Names and numbers of parameters by COLMAP's model id (<https://colmap.github.io/cameras.html>).
const MODELS: [(&str, usize); 18] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
];

/// Intrinsics whose numbers are not checked.
fn camera(model: &str, width: u64, height: u64, params: &[f64]) -> Result<SourceCamera, String> {
    let name = model.to_uppercase();
    let none = Distortion::default();
    let fisheye = |k1, k2| Distortion::fisheye([k1, k2, 0.0, 0.0]);
    let ([fx, fy], center, distortion) = match (&name[..], params) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f], [cx, cy], none),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy], [cx, cy], none),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => ([f, f], [cx, cy], Distortion::opencv(k, 0.0, 0.0, 0.0)),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f], [cx, cy], Distortion::opencv(k1, k2, 0.0, 0.0)),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => ([fx, fy], [cx, cy], Distortion::opencv(k1, k2, p1, p2)),
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
            ([fx, fy], [cx, cy], Distortion::fisheye([k1, k2, k3, k4]))
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            let (radial, divisor, tangential) = ([k1, k2, k3, 0.0, 0.0, 0.0], [k4, k5, k6], [p1, p2]);
            let full = Polynomial { radial, divisor, tangential, ..Default::default() };
            ([fx, fy], [cx, cy], Distortion::Polynomial(full))
        }
        ("FOV", &[fx, fy, cx, cy, omega]) => ([fx, fy], [cx, cy], Distortion::Fov { omega }),
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => ([f, f], [cx, cy], fisheye(k, 0.0)),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => ([f, f], [cx, cy], fisheye(k1, k2)),
        ("THIN_PRISM_FISHEYE", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx, sy]) => {
            let (radial, tangential, prism) = ([k1, k2, k3, k4, 0.0, 0.0], [p1, p2], [sx, 0.0, sy, 0.0]);
            let thin = Polynomial { fisheye: true, radial, tangential, prism, ..Default::default() };
            ([fx, fy], [cx, cy], Distortion::Polynomial(thin))
        }
        // In this model p0 belongs to x and p1 to y; in OpenCV p1 belongs to y.
        ("RAD_TAN_THIN_PRISM_FISHEYE", &[fx, fy, cx, cy, k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3]) => {
            let (radial, tangential, prism) = ([k0, k1, k2, k3, k4, k5], [p1, p0], [s0, s1, s2, s3]);
            let turns = Polynomial { fisheye: true, radial, tangential, prism, in_turn: true, ..Default::default() };
            ([fx, fy], [cx, cy], Distortion::Polynomial(turns))
        }
        ("SIMPLE_DIVISION", &[f, cx, cy, k]) => ([f, f], [cx, cy], Distortion::Division { k }),
        ("DIVISION", &[fx, fy, cx, cy, k]) => ([fx, fy], [cx, cy], Distortion::Division { k }),
        ("SIMPLE_FISHEYE", &[f, cx, cy]) => ([f, f], [cx, cy], fisheye(0.0, 0.0)),
        ("FISHEYE", &[fx, fy, cx, cy]) => ([fx, fy], [cx, cy], fisheye(0.0, 0.0)),
        ("EUCM", &[fx, fy, cx, cy, alpha, beta]) => ([fx, fy], [cx, cy], Distortion::Unified { alpha, beta }),
        // The parameters repeat the image size.
        ("EQUIRECTANGULAR", &[_, _]) => {
            let size = [width as f64, height as f64];
            (size, size.map(|side| 0.5 * side), Distortion::Equirectangular)
        }
        _ if MODELS.iter().any(|(known, _)| *known == name) => {
            return Err(format!("model {name} cannot have {} parameters", params.len()));
        }
        _ => {
            return Err(format!("model {model} is unknown (COLMAP's image_undistorter makes PINHOLE of any it knows)"));
        }
    };
    let (size, focal) = (Some([width as f64, height as f64]), Focal::Pixels([fx, fy]));
    Ok(SourceCamera { size, focal, center: Some(center), distortion })
}

/// Reads little-endian numbers.
struct Numbers<R> {
    file: R,
    /// Number of bytes that are left.
    left: u64,
}

impl<R: BufRead + Seek> Numbers<R> {
    fn new(mut file: R) -> io::Result<Self> {
        let left = file.seek(SeekFrom::End(0))?;
        file.rewind()?;
        Ok(Numbers { file, left })
    }

    fn array<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        self.file.read_exact(&mut bytes)?;
        self.left = self.left.saturating_sub(N as u64);
        Ok(bytes)
    }

    fn u32(&mut self) -> io::Result<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> io::Result<u64> {
        self.array().map(u64::from_le_bytes)
    }

    fn f64s<const N: usize>(&mut self) -> io::Result<[f64; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = f64::from_le_bytes(self.array()?);
        }
        Ok(out)
    }

    fn name(&mut self) -> io::Result<Vec<u8>> {
        let mut name = Vec::new();
        let read = self.file.read_until(0, &mut name)? as u64;
        self.left = self.left.saturating_sub(read);
        name.pop().filter(|&end| end == 0).ok_or(ErrorKind::UnexpectedEof)?;
        Ok(name)
    }

    /// Leaves out a list of `count` items of `bytes` each.
    fn skip(&mut self, count: u64, bytes: u64) -> io::Result<()> {
        let all = count.checked_mul(bytes).filter(|all| *all <= self.left).ok_or(ErrorKind::UnexpectedEof)?;
        self.left -= all;
        self.file.seek_relative(all as i64)
    }
}

/// Reads a count, and that number of records of at least `least` bytes with `record`. A count that the file cannot hold is refused
/// before anything is allocated.
fn records<R: BufRead + Seek, T>(
    file: R,
    path: &Path,
    what: &str,
    least: u64,
    mut record: impl FnMut(&mut Numbers<R>) -> io::Result<Result<T, String>>,
) -> Result<Vec<T>> {
    let fail = |what: String| Error::input(path, what);
    let ends = |error: io::Error, what: String| match error.kind() {
        ErrorKind::UnexpectedEof => fail(what),
        _ => Error::io(path, error),
    };
    let mut file = Numbers::new(file).map_err(|error| Error::io(path, error))?;
    let count = file.u64().map_err(|error| ends(error, format!("is too short for the number of {what}s")))?;
    let have = file.left;
    // guard: COLMAP: promises
    if count > have / least {
        let need = format!("at least {} bytes", u128::from(count) * u128::from(least));
        return Err(fail(format!("promises {count} {what}s, which take {need}, but has {have}")));
    }
    let mut out = Vec::with_capacity(count as usize);
    for i in 0..count {
        match record(&mut file).map_err(|error| ends(error, format!("ends in {what} {i} of {count}")))? {
            Ok(value) => out.push(value),
            Err(error) => return Err(fail(format!("{what} {i} of {count}: {error}"))),
        }
    }
    match file.left {
        0 => Ok(out),
        left => Err(fail(format!("{left} bytes are left after the {count} {what}s that it promises"))),
    }
}

pub(super) fn cameras_binary(bytes: &[u8], path: &Path) -> Result<Cameras> {
    // Id, model, width, height and two parameters.
    let list = records(Cursor::new(bytes), path, "camera", 4 + 4 + 8 + 8 + 2 * 8, |file| {
        let (id, model, width, height) = (file.u32()?, file.u32()?, file.u64()?, file.u64()?);
        let Some(&(name, count)) = MODELS.get(model as usize) else {
            return Ok(Err(format!("model number {model} is unknown")));
        };
        let mut params = Vec::with_capacity(count);
        for _ in 0..count {
            params.extend(file.f64s::<1>()?);
        }
        Ok(camera(name, width, height, &params).map(|camera| (id, camera)))
    })?;
    collect_cameras(list, path)
}

pub(super) fn cameras_text(bytes: &[u8], path: &Path) -> Result<Cameras> {
    let mut list = Vec::new();
    for (number, line) in lines(bytes, path)?.filter(|(_, line)| is_data(line)) {
        let fail = |what: String| Error::input(path, format!("line {number}: {what}"));
        let mut words = line.split_whitespace();
        let id = field(&mut words, "camera id").map_err(fail)?;
        let model: String = field(&mut words, "model").map_err(fail)?;
        let width = field(&mut words, "width").map_err(fail)?;
        let height = field(&mut words, "height").map_err(fail)?;
        let params: Vec<f64> = words.map(|word| float(word, "a parameter")).collect::<Result<_, _>>().map_err(fail)?;
        list.push((id, camera(&model, width, height, &params).map_err(fail)?));
    }
    collect_cameras(list, path)
}

fn collect_cameras(list: Vec<(u32, SourceCamera)>, path: &Path) -> Result<Cameras> {
    let mut cameras = HashMap::new();
    for (id, camera) in list {
        if cameras.insert(id, camera).is_some() {
            return Err(Error::input(path, format!("camera {id} appears twice")));
        }
    }
    Ok(cameras)
}

pub(super) fn images_binary(file: impl BufRead + Seek, path: &Path) -> Result<Vec<Pose>> {
    // Id, pose, camera, the terminator of an empty name, and the number of points.
    records(file, path, "image", 4 + 7 * 8 + 4 + 1 + 8, |file| {
        file.u32()?;
        let (quat, translation, camera) = (file.f64s()?, file.f64s()?, file.u32()?);
        let name = file.name()?;
        // Each point is x, y and the id of its 3D point.
        let points = file.u64()?;
        file.skip(points, 24)?;
        Ok(match String::from_utf8(name) {
            Ok(name) => Ok(Pose { name, quat, translation, camera }),
            Err(name) => Err(format!("the name `{}` is not UTF-8", String::from_utf8_lossy(name.as_bytes()))),
        })
    })
}

pub(super) fn images_text(bytes: &[u8], path: &Path) -> Result<Vec<Pose>> {
    let mut poses = Vec::new();
    let mut all = lines(bytes, path)?.peekable();
    while let Some((number, line)) = all.next() {
        if !is_data(line) {
            continue;
        }
        let fail = |what: String| Error::input(path, format!("line {number}: {what}"));
        let mut rest = line.trim();
        let mut word = |what: &str| {
            let (word, left) =
                rest.split_once(char::is_whitespace).ok_or_else(|| fail(format!("ends before {what}")))?;
            rest = left.trim_start();
            Ok::<&str, Error>(word)
        };
        word("the image id")?;
        let mut numbers = [0.0; 7];
        for (value, name) in numbers.iter_mut().zip(["qw", "qx", "qy", "qz", "tx", "ty", "tz"]) {
            *value = float(word(name)?, name).map_err(fail)?;
        }
        let camera = number_of(word("the camera id")?, "camera id").map_err(fail)?;
        let [qw, qx, qy, qz, translation @ ..] = numbers;
        // The rest of the line: names may contain blanks.
        poses.push(Pose { name: rest.to_owned(), quat: [qw, qx, qy, qz], translation, camera });
        // The line of points, which may be empty. Some writers leave it out, so that the next image follows.
        all.next_if(|(_, line)| is_points(line));
    }
    Ok(poses)
}

/// Whether a line holds x, y and a point's id any number of times. An image's line ends with a name.
fn is_points(line: &str) -> bool {
    let words = line.split_whitespace();
    words.clone().count().is_multiple_of(3) && words.into_iter().all(|word| word.parse::<f64>().is_ok())
}

pub(super) fn points_binary(file: impl BufRead + Seek, path: &Path, notes: &mut Vec<String>) -> Result<PointCloud> {
    // Id, position, color, error and the length of its track.
    let mut number = 0;
    let points = records(file, path, "point", 8 + 3 * 8 + 3 + 8 + 8, |file| {
        file.u64()?;
        let (position, color) = (file.f64s()?, file.array()?);
        file.f64s::<1>()?;
        let track = file.u64()?;
        file.skip(track, 8)?;
        number += 1;
        Ok(Ok((number - 1, position, color)))
    })?;
    Ok(usable(points, "point", path, notes))
}

pub(super) fn points_text(bytes: &[u8], path: &Path, notes: &mut Vec<String>) -> Result<PointCloud> {
    let mut points = Vec::new();
    for (number, line) in lines(bytes, path)?.filter(|(_, line)| is_data(line)) {
        let fail = |what: String| Error::input(path, format!("line {number}: {what}"));
        let mut words = line.split_whitespace();
        field::<u64>(&mut words, "point id").map_err(fail)?;
        let (mut position, mut color) = ([0.0; 3], [0; 3]);
        for (value, name) in position.iter_mut().zip(["x", "y", "z"]) {
            *value = float(words.next().ok_or_else(|| fail(format!("ends before {name}")))?, name).map_err(fail)?;
        }
        for (value, name) in color.iter_mut().zip(["red", "green", "blue"]) {
            *value = field(&mut words, name).map_err(fail)?;
        }
        points.push((number, position, color));
    }
    Ok(usable(points, "line", path, notes))
}

/// Keeps the points with finite positions, and adds a note for the others. `what` names the unit that their
/// numbers count.
fn usable(points: Vec<(usize, [f64; 3], [u8; 3])>, what: &str, path: &Path, notes: &mut Vec<String>) -> PointCloud {
    let (all, mut cloud, mut left_out) = (points.len(), PointCloud::default(), LeftOut::default());
    for (number, position, color) in points {
        match point(position) {
            Ok(position) => {
                cloud.positions.push(position);
                cloud.colors.push(color);
            }
            Err(why) => left_out.add(|| format!("{what} {number}"), || format!("{what} {number}: {why}")),
        }
    }
    notes.extend(left_out.note(all, "point").map(|text| format!("{}: {text}", path.display())));
    cloud
}

fn point(position: [f64; 3]) -> Result<[f64; 3], String> {
    // guard: COLMAP: points
    match position.iter().all(|&v| (v as f32).is_finite()) {
        true => Ok(position),
        false => Err(format!("the position {position:?} is not finite")),
    }
}

/// Lines with their numbers from 1.
fn lines<'a>(bytes: &'a [u8], path: &Path) -> Result<impl Iterator<Item = (usize, &'a str)> + use<'a>> {
    let text = str::from_utf8(bytes).map_err(|_| Error::input(path, "is not UTF-8 text"))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    Ok(text.lines().enumerate().map(|(i, line)| (i + 1, line)))
}

fn is_data(line: &str) -> bool {
    !line.trim().is_empty() && !line.trim_start().starts_with('#')
}

fn field<'a, T: FromStr>(words: &mut impl Iterator<Item = &'a str>, name: &str) -> Result<T, String> {
    number_of(words.next().ok_or_else(|| format!("ends before {name}"))?, name)
}

fn float(word: &str, name: &str) -> Result<f64, String> {
    if is_nan_of_windows(word) { Ok(f64::NAN) } else { number_of(word, name) }
}

fn number_of<T: FromStr>(word: &str, name: &str) -> Result<T, String> {
    word.parse().map_err(|_| format!("`{word}` is not valid for {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPENCV: [f64; 8] = [100.0, 101.0, 32.0, 24.0, 0.1, -0.02, 1e-3, 2e-3];
    const QUAT: [f64; 4] = [0.5, -0.5, 0.5, 0.5];

    fn cameras_bin(list: &[(u32, u32, &[f64])]) -> Vec<u8> {
        let mut out = (list.len() as u64).to_le_bytes().to_vec();
        for (id, model, params) in list {
            out.extend(id.to_le_bytes());
            out.extend(model.to_le_bytes());
            out.extend(64u64.to_le_bytes());
            out.extend(48u64.to_le_bytes());
            params.iter().for_each(|p| out.extend(p.to_le_bytes()));
        }
        out
    }

    fn images_bin(list: &[(&str, u32, [f64; 4], [f64; 3])], points: u64) -> Vec<u8> {
        let mut out = (list.len() as u64).to_le_bytes().to_vec();
        for (i, (name, camera, quat, translation)) in list.iter().enumerate() {
            out.extend((i as u32 + 1).to_le_bytes());
            quat.iter().chain(translation).for_each(|v| out.extend(v.to_le_bytes()));
            out.extend(camera.to_le_bytes());
            out.extend(name.bytes());
            out.push(0);
            out.extend(points.to_le_bytes());
            (0..points * 24).for_each(|i| out.push(i as u8));
        }
        out
    }

    fn points_bin(list: &[[f64; 3]]) -> Vec<u8> {
        let mut out = (list.len() as u64).to_le_bytes().to_vec();
        for (i, p) in list.iter().enumerate() {
            out.extend((i as u64).to_le_bytes());
            p.iter().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend([i as u8, 20, 30]);
            out.extend(0.5f64.to_le_bytes());
            out.extend(2u64.to_le_bytes());
            out.extend([0; 16]);
        }
        out
    }

    /// A dataset on disk with these files; image files are not decoded here.
    fn model(files: &[(&str, &[u8])]) -> (tempfile::TempDir, Result<Listing>) {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("sparse").join("0");
        fs::create_dir_all(&folder).unwrap();
        fs::create_dir_all(root.path().join("images")).unwrap();
        files.iter().for_each(|(name, bytes)| fs::write(folder.join(name), bytes).unwrap());
        let result = read_at(root.path());
        (root, result)
    }

    fn read_at(root: &Path) -> Result<Listing> {
        let options = DatasetOptions::default();
        read(root, &folders::find_model(root, &options)?.unwrap(), &options)
    }

    fn error(files: &[(&str, &[u8])]) -> String {
        model(files).1.err().unwrap().to_string()
    }

    /// Each parameter has a different value, so that a swap shows.
    #[test]
    fn every_model_gives_its_intrinsics_in_both_formats() {
        let polynomial = |p: Polynomial| Distortion::Polynomial(p);
        let of = |fisheye, terms: &[f64], tangential| {
            let mut radial = [0.0; 6];
            radial[..terms.len()].copy_from_slice(terms);
            Polynomial { fisheye, radial, tangential, ..Default::default() }
        };
        let [none, round] = [false, true].map(|fisheye| of(fisheye, &[], [0.0; 2]));
        let (f, c) = (100.0, [32.0, 24.0]);
        let thin = Polynomial { prism: [0.7, 0.0, 0.8, 0.0], ..of(true, &[0.1, 0.2, 0.5, 0.6], [0.3, 0.4]) };
        let turns = of(true, &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6], [0.8, 0.7]);
        let turns = Polynomial { prism: [0.9, 1.0, 1.1, 1.2], in_turn: true, ..turns };
        let full = Polynomial { divisor: [0.6, 0.7, 0.8], ..of(false, &[0.1, 0.2, 0.5], [0.3, 0.4]) };
        // COLMAP's number of the model; number of focal lengths; expected distortion for the parameters after
        // the principal point.
        let cases: [(usize, usize, Distortion); 17] = [
            (1, 0, polynomial(none)),
            (2, 0, polynomial(none)),
            (1, 1, Distortion::opencv(0.1, 0.0, 0.0, 0.0)),
            (1, 2, Distortion::opencv(0.1, 0.2, 0.0, 0.0)),
            (2, 4, Distortion::opencv(0.1, 0.2, 0.3, 0.4)),
            (2, 4, Distortion::fisheye([0.1, 0.2, 0.3, 0.4])),
            (2, 8, polynomial(full)),
            (2, 1, Distortion::Fov { omega: 0.1 }),
            (1, 1, Distortion::fisheye([0.1, 0.0, 0.0, 0.0])),
            (1, 2, Distortion::fisheye([0.1, 0.2, 0.0, 0.0])),
            (2, 8, polynomial(thin)),
            (2, 12, polynomial(turns)),
            (1, 1, Distortion::Division { k: 0.1 }),
            (2, 1, Distortion::Division { k: 0.1 }),
            (1, 0, polynomial(round)),
            (2, 0, polynomial(round)),
            (2, 2, Distortion::Unified { alpha: 0.1, beta: 0.2 }),
        ];
        let path = Path::new("cameras");
        let both = |id: usize, params: &[f64]| {
            let binary = cameras_binary(&cameras_bin(&[(7, id as u32, params)]), path).unwrap()[&7];
            let words: Vec<String> = params.iter().map(f64::to_string).collect();
            for name in [MODELS[id].0.to_owned(), MODELS[id].0.to_lowercase()] {
                let text = format!("\u{feff}# Camera list\r\n\r\n7 {name} 64 48 {}\r\n", words.join(" "));
                assert_eq!(cameras_text(text.as_bytes(), path).unwrap()[&7], binary, "{name}");
            }
            binary
        };
        let size = Some([64.0, 48.0]);
        for (id, &(focals, rest, distortion)) in cases.iter().enumerate() {
            let focal = &[f, f + 1.0][..focals];
            let rest: Vec<f64> = (1..=rest).map(|i| i as f64 / 10.0).collect();
            let params = [focal, &c, &rest].concat();
            let focal = Focal::Pixels([focal[0], *focal.last().unwrap()]);
            let expected = SourceCamera { size, focal, center: Some(c), distortion };
            assert_eq!(both(id, &params), expected, "{}", MODELS[id].0);
        }
        let (focal, center) = (Focal::Pixels([64.0, 48.0]), Some([32.0, 24.0]));
        let sphere = SourceCamera { size, focal, center, distortion: Distortion::Equirectangular };
        assert_eq!(both(17, &[64.0, 48.0]), sphere);
    }

    /// A regression test: half of the images were once lost silently.
    #[test]
    fn an_images_file_without_lines_of_points_is_read_whole() {
        let names = |text: &str| {
            let poses = images_text(text.as_bytes(), Path::new("images.txt")).unwrap();
            poses.into_iter().map(|pose| pose.name).collect::<Vec<_>>()
        };
        let pose = "1 0 0 0 0 0 0 7";
        assert_eq!(names(&format!("1 {pose} a.png\n1.5 2 -1 3 4 17\n2 {pose} b c.png\n")), ["a.png", "b c.png"]);
        assert_eq!(names(&format!("1 {pose} 0001\n2 {pose} 0002\n")), ["0001", "0002"]);
        let bad = images_text(format!("1 {pose} a.png\n1.5 2\n").as_bytes(), Path::new("images.txt")).err().unwrap();
        assert!(bad.to_string().contains("line 2"), "{bad}");
    }

    #[test]
    fn what_is_wrong_is_named() {
        let camera = cameras_bin(&[(7, 4, &OPENCV)]);
        let pose = |name: &'static str, camera, quat| images_bin(&[(name, camera, quat, [0.0; 3])], 0);
        let image = pose("a.jpg", 7, QUAT);
        #[track_caller]
        fn expect(files: &[(&str, &[u8])], parts: &[&str]) {
            let message = error(files);
            parts.iter().for_each(|part| assert!(message.contains(part), "`{part}` is not in: {message}"));
        }
        let with = |cameras: &[u8], images: &[u8], parts: &[&str]| {
            expect(&[("cameras.bin", cameras), ("images.bin", images)], parts);
        };
        with(&cameras_bin(&[(7, 99, &OPENCV)]), &image, &["cameras.bin", "camera 0", "model number 99"]);
        with(&cameras_bin(&[(7, 4, &OPENCV), (7, 4, &OPENCV)]), &image, &["camera 7", "twice"]);
        with(&camera[..camera.len() - 1], &image, &["ends in camera 0 of 1"]);
        with(&[&camera[..], &[0]].concat(), &image, &["1 bytes are left after the 1 cameras"]);
        with(&camera, &pose("a.jpg", 8, QUAT), &["a.jpg", "camera 8 is not in the model"]);
        with(&camera, &images_bin(&[], 0), &["no images"]);
        with(&camera, &u64::MAX.to_le_bytes(), &["images.bin", "promises 18446744073709551615 images", "has 0"]);
        with(&camera, b"abc", &["images.bin", "too short"]);
        expect(&[("cameras.bin", &camera)], &["images.txt"]);
        let path = Path::new("x.txt");
        let text = |result: Result<Cameras>| result.err().unwrap().to_string();
        assert!(text(cameras_text(b"1 PINHOLE 64 48 1 1 1", path)).contains("line 1: model PINHOLE cannot have 3"));
        assert!(
            text(cameras_text(b"#\n1 PINHOLE 64 wide 1 1 1 1", path))
                .contains("line 2: `wide` is not valid for height")
        );
        assert!(text(cameras_text(b"1 PINHOLE", path)).contains("ends before width"));
        assert!(text(cameras_text(b"1 WIDE 64 48 1 1 1 1", path)).contains("line 1: model WIDE is unknown"));
        let images = images_text(b"1 0.5 0.5 0.5 0.5 1 2\n\n", path).err().unwrap().to_string();
        assert!(images.contains("line 1: ends before ty"), "{images}");
    }

    /// Lost photos, and points of depth cameras, have NaN.
    #[test]
    fn poses_and_points_that_are_none_are_left_out_and_told() {
        let camera = cameras_bin(&[(7, 4, &OPENCV)]);
        let nan = f64::NAN;
        let poses = [
            ("a", 7, [2.0, 0.0, 0.0, 0.0], [0.0; 3]),
            ("b", 7, [nan; 4], [0.0; 3]),
            ("c", 7, [0.0; 4], [0.0; 3]),
            ("d", 7, QUAT, [0.0, f64::NEG_INFINITY, 0.0]),
        ];
        let words = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let line = |(name, camera, quat, translation): &(&str, u32, [f64; 4], [f64; 3])| {
            format!("1 {} {} {camera} {name}\n\n", words(quat), words(translation))
        };
        let text: String = poses.iter().map(line).collect();
        let windows = text.replace("NaN NaN NaN NaN", "-nan(ind) nan 1.#QNAN -1.#IND");
        let points = [[1.0, 2.0, 3.0], [nan; 3], [0.0, 1e60, 0.0], [4.0, 5.0, 6.0]];
        let point = |p: &[f64; 3]| format!("1 {} 0 20 30 0.5\n", words(p));
        let points_text: String = points.iter().map(point).collect();
        for (images, cloud, place) in [
            (("images.bin", images_bin(&poses, 1)), ("points3D.bin", points_bin(&points)), "point 1"),
            (("images.txt", text.into_bytes()), ("points3D.txt", points_text.into_bytes()), "line 2"),
            (("images.txt", windows.into_bytes()), ("points3D.txt", point(&[nan, 0.0, 0.0]).into_bytes()), "line 1"),
        ] {
            let (_root, listed) = model(&[("cameras.bin", &camera), (images.0, &images.1), (cloud.0, &cloud.1)]);
            let listed = listed.unwrap();
            assert_eq!(
                listed.entries.iter().map(|entry| entry.lost.is_none()).collect::<Vec<_>>(),
                [true, false, false, false]
            );
            assert_eq!(listed.entries[0].rotation, DMat3::IDENTITY);
            assert!(listed.entries[1].lost.as_ref().unwrap().contains("not finite or has no rotation"));
            let note = &listed.notes[0];
            assert!(note.contains(cloud.0) && note.contains(place) && note.contains("not finite"), "{note}");
            if place == "line 1" {
                assert_eq!((listed.points, note.contains("1 point of 1 left out")), (None, true));
                continue;
            }
            assert_eq!(listed.points.unwrap().positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
            assert!(note.contains("2 points of 4 left out"), "{note}");
        }
    }

    #[test]
    fn images_whose_camera_is_none_are_left_out() {
        let nan = f64::NAN;
        let cameras = cameras_bin(&[(6, 1, &[1.0; 4]), (7, 1, &[nan, 1.0, 1.0, 1.0]), (8, 1, &[1.0, 1.0, nan, 1.0])]);
        let images = images_bin(&[6, 7, 8].map(|camera| ("a", camera, QUAT, [0.0; 3])), 0);
        let text = b"6 PINHOLE 64 48 1 1 1 1\n7 PINHOLE 64 48 -nan(ind) 1 1 1\n8 PINHOLE 64 48 1 1 nan 1\n";
        for cameras in [("cameras.bin", &cameras[..]), ("cameras.txt", text)] {
            let entries = model(&[cameras, ("images.bin", &images)]).1.unwrap().entries;
            let lost = |i: usize| entries[i].lost.clone().unwrap();
            assert!(
                entries[0].lost.is_none() && lost(1).starts_with("camera 7: the focal lengths [NaN, 1.0]"),
                "{}",
                lost(1)
            );
            assert!(lost(2).starts_with("camera 8: the principal point [NaN, 1.0]"), "{}", lost(2));
        }
    }

    /// A model next to a transforms.json in another frame: rotated, moved and scaled, as with nerfstudio's
    /// `applied_transform`.
    #[test]
    fn points_follow_the_cameras_into_their_frame() {
        let eyes = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
        let spins = [0.1, 0.7, -0.4].map(DQuat::from_rotation_y);
        let pose = |i: usize| {
            let t = -(spins[i] * DVec3::from_array(eyes[i]));
            let q = spins[i];
            (["a.png", "sub/b.png", "c.png"][i], 7, [q.w, q.x, q.y, q.z], t.to_array())
        };
        let images = images_bin(&[pose(0), pose(1), pose(2)], 0);
        let cloud = points_bin(&[[1.0, 2.0, 3.0], [-4.0, 5.0, 0.5]]);
        let (root, listed) = model(&[
            ("cameras.bin", &cameras_bin(&[(7, 4, &OPENCV)])),
            ("images.bin", &images),
            ("points3D.bin", &cloud),
        ]);
        let folder = root.path().join("sparse/0");
        let (scale, turn, shift) = (2.5, DMat3::from_cols(DVec3::Y, DVec3::X, -DVec3::Z), DVec3::new(7.0, -8.0, 9.0));
        let moved = |p: [f64; 3]| scale * (turn * DVec3::from_array(p)) + shift;
        let mut entries = listed.unwrap().entries;
        for (i, entry) in entries.iter_mut().enumerate() {
            entry.name = ["images/a.jpg", "images_2/sub/b.png", "/home/x/c.png"][i].into();
            entry.rotation *= turn.transpose();
            entry.translation = -(entry.rotation * moved(eyes[i]));
        }
        let found = |entries: &[Entry]| points_for(&folder, entries, &mut Vec::new());
        let (points, source) = found(&entries).unwrap().unwrap();
        assert!(source.ends_with("points3D.bin"));
        for (found, expected) in points.positions.iter().zip([[1.0, 2.0, 3.0], [-4.0, 5.0, 0.5]]) {
            let off = DVec3::from_array(found.map(f64::from)) - moved(expected);
            assert!(off.length() < 1e-5, "{found:?}");
        }
        assert_eq!(points.colors[1], [1, 20, 30]);
        // A single photo gives no scale: keep the model's.
        let alone = found(&entries[..1]).unwrap().unwrap().0.positions[0].map(f64::from);
        assert!((DVec3::from_array(alone) - moved(eyes[0]) - DVec3::new(2.0, 0.0, -3.0)).length() < 1e-5, "{alone:?}");
        // A model of another run.
        entries[2].translation = -(entries[2].rotation * moved([0.0, 0.0, 3.2]));
        assert!(found(&entries).unwrap_err().contains("do not stand"));
        entries.iter_mut().for_each(|entry| entry.name = "other.png".into());
        assert!(found(&entries).unwrap_err().contains("none of its images"));
    }
}

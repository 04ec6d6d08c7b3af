//! transforms.json: NeRF Synthetic (Blender), instant-ngp and nerfstudio.
//!
//! Poses are camera-to-world in OpenGL axes (x right, y up, z backward).

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use serde::Deserialize;

use super::dataset::{Focal, Shot, SourceCamera, Split};
use super::distortion::Distortion;
use super::ply::{self, PointCloud};
use crate::{Error, Result};

const TRAIN: &str = "transforms_train.json";
const TEST: &str = "transforms_test.json";
const PLAIN: &str = "transforms.json";

/// The largest entry by which RᵀR may differ from a multiple of the identity. Matrices written in float32 differ by 1e-6, those
/// with six digits by 1e-5; an error of 1e-3 radian moves a picture with a focal length of 1000 by a pixel.
const MAX_SKEW: f64 = 1e-3;

#[derive(Deserialize)]
struct File {
    #[serde(flatten)]
    camera: Camera,
    frames: Vec<Frame>,
    ply_file_path: Option<String>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    camera: Camera,
}

/// What may stand once for all frames or in a frame, which then counts.
#[derive(Deserialize)]
struct Camera {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

/// What was read: `blender` when the focal length is given as an angle only.
pub(super) struct Transforms {
    pub(super) shots: Vec<Shot>,
    pub(super) points: Option<PointCloud>,
    pub(super) blender: bool,
    /// The files that were read.
    pub(super) sources: Vec<PathBuf>,
}

/// The file to begin with if `path` is a transforms file or a folder with one.
pub(super) fn find(path: &Path) -> Option<PathBuf> {
    if path.is_file() {
        return path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")).then(|| path.to_owned());
    }
    [TRAIN, PLAIN].into_iter().map(|name| path.join(name)).find(|path| path.is_file())
}

/// Reads `path`. In a folder, transforms_train.json comes with transforms_test.json beside it; a file that was named itself comes
/// alone.
pub(super) fn read(path: &Path, named_itself: bool) -> Result<Transforms> {
    let test = path.with_file_name(TEST);
    let is_train = path.file_name().is_some_and(|name| name == TRAIN);
    if named_itself || !is_train || !test.is_file() {
        return read_file(path, None);
    }
    let mut all = read_file(path, Some(Split::Train))?;
    let test = read_file(&test, Some(Split::Test))?;
    all.shots.extend(test.shots);
    all.sources.extend(test.sources);
    Ok(all)
}

fn read_file(path: &Path, split: Option<Split>) -> Result<Transforms> {
    let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
    let file = parse(&bytes, path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut shots = Vec::with_capacity(file.frames.len());
    for (i, frame) in file.frames.iter().enumerate() {
        let (camera, rotation, translation) = file.view(i, path)?;
        shots.push(Shot {
            name: frame.file_path.clone(),
            path: find_image(folder, &frame.file_path).map_err(|what| frame.fault(i, path, &what))?,
            listed_in: path.to_owned(),
            camera,
            rotation,
            translation,
            split,
        });
    }
    let cloud = file.ply_file_path.map(|name| folder.join(name));
    let points = cloud.as_ref().map(ply::read_points).transpose()?;
    let blender = shots.iter().all(|shot| matches!(shot.camera.focal, Focal::Angles { .. }));
    let sources = std::iter::once(path.to_owned()).chain(cloud).collect();
    Ok(Transforms { shots, points: points.filter(|p| !p.positions.is_empty()), blender, sources })
}

impl Frame {
    fn fault(&self, index: usize, path: &Path, what: &str) -> Error {
        Error::input(path, format!("frame {index} (`{}`): {what}", self.file_path))
    }
}

impl File {
    /// Intrinsics, and rotation and translation from world to camera, of one frame.
    fn view(&self, index: usize, path: &Path) -> Result<(SourceCamera, DMat3, DVec3)> {
        let frame = &self.frames[index];
        let fail = |what: String| frame.fault(index, path, &what);
        let (rotation, translation) = pose(&frame.transform_matrix).map_err(fail)?;
        Ok((source_camera(&frame.camera, &self.camera).map_err(fail)?, rotation, translation))
    }
}

/// Reads `bytes` and judges every frame as [`read`] does, without looking for its image.
pub(super) fn check(bytes: &[u8], path: &Path) -> Result<()> {
    let file = parse(bytes, path)?;
    (0..file.frames.len()).try_for_each(|i| file.view(i, path).map(drop))
}

fn parse(bytes: &[u8], path: &Path) -> Result<File> {
    let file: File = serde_json::from_slice(bytes)
        .map_err(|error| Error::input(path, format!("is not a sound transforms file: {error}")))?;
    if file.frames.is_empty() {
        return Err(Error::input(path, "`frames` is empty"));
    }
    Ok(file)
}

/// NeRF Synthetic leaves endings out.
fn find_image(folder: &Path, name: &str) -> Result<PathBuf, String> {
    let endings = ["", ".png", ".jpg", ".jpeg"];
    let paths = endings.iter().map(|ending| folder.join(format!("{name}{ending}")));
    let missing = || format!("no image `{}` there, nor with .png, .jpg or .jpeg", folder.join(name).display());
    paths.into_iter().find(|path| path.is_file()).ok_or_else(missing)
}

fn source_camera(frame: &Camera, all: &Camera) -> Result<SourceCamera, String> {
    macro_rules! given {
        ($field:ident) => {
            frame.$field.or(all.$field)
        };
    }
    let model = frame.camera_model.as_deref().or(all.camera_model.as_deref()).unwrap_or("OPENCV");
    if !["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"].contains(&model) {
        return Err(format!("camera_model {model} is not read; OPENCV and the models it contains are"));
    }
    if given!(is_fisheye) == Some(true) {
        return Err("`is_fisheye` is set; fisheye cameras are not read".into());
    }
    // k1, k2, k3 mean the same to all writers. k4 does not: OpenCV divides by it, nerfstudio multiplies.
    if let Some(k4) = given!(k4).filter(|&k4| k4 != 0.0) {
        return Err(format!("`k4` is {k4}; only k1, k2, k3, p1 and p2 are read"));
    }
    let focal = match (given!(fl_x), given!(camera_angle_x)) {
        (Some(x), _) => Focal::Pixels([x, given!(fl_y).unwrap_or(x)]),
        (None, Some(x)) => Focal::Angles { x, y: given!(camera_angle_y) },
        (None, None) => return Err("has neither `fl_x` nor `camera_angle_x`".into()),
    };
    let pair = |a: Option<f64>, b: Option<f64>, names: &str| match (a, b) {
        (Some(a), Some(b)) => Ok(Some([a, b])),
        (None, None) => Ok(None),
        _ => Err(format!("has only one of {names}")),
    };
    let camera = SourceCamera {
        size: pair(given!(w), given!(h), "`w` and `h`")?,
        focal,
        center: pair(given!(cx), given!(cy), "`cx` and `cy`")?,
        distortion: Distortion {
            k1: given!(k1).unwrap_or(0.0),
            k2: given!(k2).unwrap_or(0.0),
            k3: given!(k3).unwrap_or(0.0),
            p1: given!(p1).unwrap_or(0.0),
            p2: given!(p2).unwrap_or(0.0),
        },
    };
    camera.check()?;
    Ok(camera)
}

/// World-to-camera rotation and translation in OpenCV axes from a camera-to-world matrix in OpenGL axes. A uniform scale of the
/// rotation part (a scaled camera object in Blender) changes no ray and is taken out; skew and mirroring are refused.
fn pose(rows: &[Vec<f64>]) -> Result<(DMat3, DVec3), String> {
    if !(rows.len() == 3 || rows.len() == 4) || rows.iter().any(|row| row.len() != 4) {
        return Err("`transform_matrix` is not 4 × 4 (or 3 × 4)".into());
    }
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
    use proptest::prelude::*;
    use serde_json::{Value, json};

    use super::*;

    /// A camera at (1, 2, 3) turned about x by a right angle: it looks along world +y with +z up.
    const UPRIGHT: [[f64; 4]; 4] =
        [[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, -1.0, 2.0], [0.0, 1.0, 0.0, 3.0], [0.0, 0.0, 0.0, 1.0]];

    fn rows(matrix: [[f64; 4]; 4]) -> Vec<Vec<f64>> {
        matrix.iter().map(|row| row.to_vec()).collect()
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

    /// Reads a transforms.json with these members and one frame with those.
    fn one(all: Value, frame: Value) -> Result<Shot> {
        let mut file = json!({"frames": [{"file_path": "a.png", "transform_matrix": UPRIGHT}]});
        let merge = |into: &mut Value, from: &Value| {
            let (Value::Object(into), Value::Object(from)) = (into, from) else { panic!("not objects") };
            into.extend(from.clone());
        };
        merge(&mut file, &all);
        merge(&mut file["frames"][0], &frame);
        let folder = folder(&[("transforms.json", &file.to_string()), ("a.png", ""), ("b.jpeg", "")]);
        Ok(read(&find(folder.path()).unwrap(), false)?.shots.remove(0))
    }

    #[track_caller]
    fn expect(all: Value, frame: Value, parts: &[&str]) {
        let message = one(all, frame).err().unwrap().to_string();
        for part in parts.iter().chain(&["transforms.json"]) {
            assert!(message.contains(part), "`{part}` is not in: {message}");
        }
    }

    #[test]
    fn opengl_poses_become_opencv_ones() {
        let (rotation, translation) = pose(&rows(UPRIGHT)).unwrap();
        let camera = |p: DVec3| rotation * p + translation;
        assert!((camera(DVec3::new(1.0, 7.0, 3.0)) - DVec3::new(0.0, 0.0, 5.0)).length() < 1e-12);
        // Up is −y, right stays right.
        assert!((camera(DVec3::new(1.5, 7.0, 4.0)) - DVec3::new(0.5, -1.0, 5.0)).length() < 1e-12);
        assert_eq!(pose(&rows(UPRIGHT)[..3]).unwrap(), (rotation, translation));
    }

    #[test]
    fn a_uniform_scale_changes_nothing_and_small_errors_are_taken_out() {
        let exact = pose(&rows(UPRIGHT)).unwrap();
        for scale in [1e-3, 0.5, 40.0] {
            let mut scaled = UPRIGHT;
            scaled[..3].iter_mut().for_each(|row| row[..3].iter_mut().for_each(|v| *v *= scale));
            let (rotation, translation) = pose(&rows(scaled)).unwrap();
            assert!((rotation - exact.0).to_cols_array().iter().all(|v| v.abs() < 1e-12));
            assert!((translation - exact.1).length() < 1e-12);
        }
        let mut skewed = UPRIGHT;
        skewed[0][1] = 9e-4;
        let (rotation, _) = pose(&rows(skewed)).unwrap();
        let gram = rotation.transpose() * rotation - DMat3::IDENTITY;
        assert!(gram.to_cols_array().iter().all(|v| v.abs() < 1e-12));
    }

    #[test]
    fn bad_matrices_are_refused_by_frame() {
        let edited = |row: usize, column: usize, value: f64| {
            let mut matrix = UPRIGHT;
            matrix[row][column] = value;
            json!({"transform_matrix": matrix})
        };
        let all = || json!({"camera_angle_x": 0.7});
        expect(all(), edited(0, 1, 0.01), &["frame 0", "a.png", "RᵀR"]);
        expect(all(), edited(0, 0, 1.1), &["RᵀR"]);
        expect(all(), edited(0, 0, -1.0), &["determinant"]);
        expect(all(), edited(0, 0, 0.0), &["determinant"]);
        expect(all(), edited(3, 3, 2.0), &["last row"]);
        expect(all(), json!({"transform_matrix": [[1, 0, 0, 0]]}), &["4 × 4"]);
        expect(all(), json!({"transform_matrix": [[1, 0], [1, 0], [1, 0], [1, 0]]}), &["4 × 4"]);
        expect(all(), json!({"transform_matrix": null}), &["not a sound transforms file", "line 1"]);
        assert!(pose(&vec![vec![f64::NAN; 4]; 4]).unwrap_err().contains("not finite"));
    }

    #[test]
    fn intrinsics_stand_in_the_file_or_in_the_frame_which_counts_first() {
        let all = json!({"fl_x": 100, "fl_y": 90.5, "cx": 30, "cy": 20, "w": 64, "h": 48.0, "k1": 0.1, "k3": 0.01, "p2": 1e-3});
        let camera = one(all.clone(), json!({"fl_x": 110.0, "k1": 0.2})).unwrap().camera;
        let distortion = Distortion { k1: 0.2, k2: 0.0, k3: 0.01, p1: 0.0, p2: 1e-3 };
        let (size, center) = (Some([64.0, 48.0]), Some([30.0, 20.0]));
        assert_eq!(camera, SourceCamera { size, focal: Focal::Pixels([110.0, 90.5]), center, distortion });
        let camera = one(json!({"fl_x": 100}), json!({})).unwrap().camera;
        let distortion = Distortion::default();
        assert_eq!(camera, SourceCamera { size: None, focal: Focal::Pixels([100.0, 100.0]), center: None, distortion });
        let camera = one(json!({"camera_angle_x": 0.7, "camera_model": "PINHOLE"}), json!({})).unwrap().camera;
        assert_eq!(camera.focal, Focal::Angles { x: 0.7, y: None });
        // Endings that were left out are found.
        assert!(one(all, json!({"file_path": "./b"})).unwrap().path.ends_with("b.jpeg"));
    }

    #[test]
    fn cameras_that_are_not_read_are_named() {
        let with = |all: Value, parts: &[&str]| expect(all, json!({}), parts);
        with(json!({}), &["frame 0", "fl_x", "camera_angle_x"]);
        with(json!({"fl_x": 1.0, "camera_model": "OPENCV_FISHEYE"}), &["OPENCV_FISHEYE"]);
        with(json!({"fl_x": 1.0, "is_fisheye": true}), &["is_fisheye"]);
        with(json!({"fl_x": 1.0, "k4": 0.1}), &["k4"]);
        with(json!({"fl_x": -1.0}), &["focal lengths"]);
        with(json!({"camera_angle_x": 3.2}), &["field of view"]);
        with(json!({"fl_x": 1.0, "w": 64}), &["only one of `w` and `h`"]);
        with(json!({"fl_x": 1.0, "w": 0, "h": 5}), &["size"]);
        with(json!({"fl_x": "wide"}), &["not a sound transforms file"]);
        expect(json!({"fl_x": 1.0}), json!({"file_path": "none"}), &["frame 0", "none", ".png, .jpg or .jpeg"]);
        assert!(
            parse(b"{\"frames\": []}", Path::new("t.json")).err().unwrap().to_string().contains("`frames` is empty")
        );
        assert!(parse(b"{\"frames\": NaN}", Path::new("t.json")).err().unwrap().to_string().contains("t.json"));
    }

    #[test]
    fn test_views_come_only_with_a_folder() {
        let file = |name: &str| {
            let frame = json!({"file_path": name, "transform_matrix": UPRIGHT});
            json!({"camera_angle_x": 0.7, "frames": [frame]}).to_string()
        };
        let (train, test) = (file("./train/r_0"), file("./test/r_0"));
        let files = [
            (TRAIN, &train[..]),
            (TEST, &test),
            ("transforms_val.json", "{"),
            ("train/r_0.png", ""),
            ("test/r_0.png", ""),
        ];
        let folder = folder(&files);
        let both = read(&find(folder.path()).unwrap(), false).unwrap();
        assert!(both.blender);
        let splits: Vec<_> = both.shots.iter().map(|shot| (&shot.name[..], shot.split)).collect();
        assert_eq!(splits, [("./train/r_0", Some(Split::Train)), ("./test/r_0", Some(Split::Test))]);
        let alone = read(&find(&folder.path().join(TRAIN)).unwrap(), true).unwrap();
        assert_eq!((alone.shots.len(), alone.shots[0].split), (1, None));
    }

    #[test]
    fn only_points_that_are_named_are_read() {
        let frame = json!({"file_path": "a.png", "transform_matrix": UPRIGHT});
        let plain = json!({"fl_x": 9.0, "frames": [frame]}).to_string();
        let named = json!({"fl_x": 9.0, "frames": [frame], "ply_file_path": "points.ply"}).to_string();
        let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
        let with = |json: &str, name: &str| {
            let folder = folder(&[(PLAIN, json), ("a.png", ""), (name, ply)]);
            read(&folder.path().join(PLAIN), false).map(|read| read.points.map(|p| p.positions))
        };
        assert_eq!(with(&plain, "points.ply").unwrap(), None);
        assert_eq!(with(&named, "points.ply").unwrap(), Some(vec![[1.0, 2.0, 3.0]]));
        assert!(with(&named, "other.ply").unwrap_err().to_string().contains("points.ply"));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]
        #[test]
        fn no_damage_makes_the_reader_panic(cut in 0.0..2.0f64, flips in prop::collection::vec((0.0..1.0f64, any::<u8>()), 0..4)) {
            let frame = json!({"file_path": "a.png", "transform_matrix": UPRIGHT, "k1": 0.5});
            let mut bytes = json!({"fl_x": 9.0, "w": 64, "h": 48, "frames": [frame]}).to_string().into_bytes();
            for (at, value) in &flips {
                let at = (at * bytes.len() as f64) as usize;
                bytes[at] ^= value;
            }
            bytes.truncate((cut * bytes.len() as f64) as usize);
            if let Ok(file) = parse(&bytes, Path::new("t.json")) {
                for frame in &file.frames {
                    let _ = pose(&frame.transform_matrix);
                    let _ = source_camera(&frame.camera, &file.camera).and_then(|camera| camera.for_image([64, 48]));
                }
            }
        }
    }
}

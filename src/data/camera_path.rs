//! Camera paths: sequences of poses in a JSON file.

use std::{fs, path::Path};

use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::write_text;
use crate::scene::Camera;
use crate::{Error, Result};

/// Maximum side of a picture, pixels, to reject mistyped numbers.
const MAX_SIDE: u32 = 16_384;
/// Maximum magnitude of any other number.
const LARGEST: f64 = 1e30;

/// Poses of one camera, for pictures of one size.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CameraPath {
    /// Cameras of the same size.
    keys: Vec<Camera>,
}

/// Contents of the file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    /// Size of the pictures, pixels.
    width: u32,
    height: u32,
    keys: Vec<Key>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Key {
    /// Position of the camera, scene units.
    eye: [f64; 3],
    /// Rotation from world axes to the camera's (x right, y down, z forward): a quaternion, w first.
    rotation: [f64; 4],
    /// Horizontal and vertical focal length, pixels.
    focal: [f64; 2],
    /// The principal point, pixels from the upper left corner.
    center: [f64; 2],
}

impl CameraPath {
    /// Width and height of the pictures, from the first key; `None` without keys.
    pub fn size(&self) -> Option<[u32; 2]> {
        self.keys.first().map(|key| [key.width, key.height])
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.keys.len()
    }

    /// Whether there is no pose yet.
    pub fn is_empty(&self) -> bool {
        self.keys.is_empty()
    }

    /// Adds a pose; a camera of another size is fitted to the size of the first.
    pub fn push(&mut self, camera: Camera) {
        let [width, height] = self.size().unwrap_or([camera.width, camera.height]);
        self.keys.push(camera.fitted(width, height));
    }

    /// `frames` cameras evenly spaced over the path, from the first key to the last: eye and focal lengths along Catmull-Rom
    /// splines, the rotation along great circles. A single frame is the first key.
    pub fn frames(&self, frames: usize) -> Vec<Camera> {
        let last = self.keys.len().saturating_sub(1) as f64;
        let at = |i: usize| self.at(last * i as f64 / frames.saturating_sub(1).max(1) as f64);
        (0..frames).filter_map(at).collect()
    }

    /// The camera at `t`, 0 at the first key and 1 more at each; `None` without keys.
    pub fn at(&self, t: f64) -> Option<Camera> {
        let last = self.keys.len().checked_sub(1)?;
        let t = t.clamp(0.0, last as f64);
        let (i, u) = (t as usize, t.fract());
        let key = self.keys[i];
        if u == 0.0 {
            return Some(key);
        }
        let next = self.keys[i + 1];
        // A path continues straight beyond its ends.
        let around = |of: &dyn Fn(&Camera) -> DVec3| {
            let (b, c) = (of(&key), of(&next));
            let a = i.checked_sub(1).map_or(2.0 * b - c, |i| of(&self.keys[i]));
            let d = self.keys.get(i + 2).map_or(2.0 * c - b, of);
            catmull_rom([a, b, c, d], u)
        };
        let eye = around(&Camera::eye);
        // Focal lengths are interpolated as logarithms, so that they stay positive.
        let focal = around(&|c| DVec3::new(c.fx.ln(), c.fy.ln(), 0.0));
        let center = around(&|c| DVec3::new(c.cx, c.cy, 0.0));
        let [from, to] = [key, next].map(|c| DQuat::from_mat3(&c.rotation));
        let rotation = DMat3::from_quat(from.slerp(to, u).normalize());
        Some(Camera {
            fx: focal.x.exp(),
            fy: focal.y.exp(),
            cx: center.x,
            cy: center.y,
            rotation,
            translation: -(rotation * eye),
            ..key
        })
    }

    /// Reads a file written by [`CameraPath::write`].
    ///
    /// # Errors
    /// [`Error::Input`], naming the key and the field.
    pub fn read(path: impl AsRef<Path>) -> Result<CameraPath> {
        let path = path.as_ref();
        let bytes = fs::read(path).map_err(|source| Error::io(path, source))?;
        CameraPath::parse(&bytes, path)
    }

    pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<CameraPath> {
        let bad = |what: String| Error::input(path, what);
        let file: File = serde_json::from_slice(bytes).map_err(|error| {
            bad(format!("{error}; expected a camera path, as K and Shift-K of glint view save one"))
        })?;
        for (name, side) in [("width", file.width), ("height", file.height)] {
            if !(1..=MAX_SIDE).contains(&side) {
                return Err(bad(format!("{name} is {side}, expected 1 to {MAX_SIDE} pixels")));
            }
        }
        if file.keys.is_empty() {
            return Err(bad("keys is empty, expected one pose at least".into()));
        }
        let mut keys = Vec::with_capacity(file.keys.len());
        for (i, Key { eye, rotation: [w, x, y, z], focal, center }) in file.keys.into_iter().enumerate() {
            let quaternion = DQuat::from_xyzw(x, y, z, w);
            let length = quaternion.length();
            // Keeps cameras, and any between two keys, finite in float32.
            let bounded = |v: &f64| v.abs() <= LARGEST;
            let expected = [
                ("eye", eye.iter().all(bounded), "numbers of at most 1e30"),
                // Tolerates quaternions typed with three digits.
                ("rotation", (length - 1.0).abs() < 0.01, "a quaternion of length 1"),
                ("focal", focal.iter().all(|v| bounded(v) && *v > 0.0), "numbers above 0, of at most 1e30"),
                ("center", center.iter().all(bounded), "numbers of at most 1e30"),
            ];
            if let Some((field, _, what)) = expected.into_iter().find(|(_, holds, _)| !holds) {
                return Err(bad(format!("keys[{i}].{field}: expected {what}")));
            }
            let rotation = DMat3::from_quat(quaternion / length);
            keys.push(Camera {
                width: file.width,
                height: file.height,
                fx: focal[0],
                fy: focal[1],
                cx: center[0],
                cy: center[1],
                rotation,
                translation: -(rotation * DVec3::from(eye)),
            });
        }
        Ok(CameraPath { keys })
    }

    /// Writes the path, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Usage`] without keys; [`Error::Io`] if writing fails.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        let Some([width, height]) = self.size() else {
            return Err(Error::Usage("a camera path without poses".into()));
        };
        let keys = self.keys.iter().map(|camera| {
            let q = DQuat::from_mat3(&camera.rotation);
            Key {
                eye: camera.eye().to_array(),
                rotation: [q.w, q.x, q.y, q.z],
                focal: [camera.fx, camera.fy],
                center: [camera.cx, camera.cy],
            }
        });
        let file = File { width, height, keys: keys.collect() };
        let text = serde_json::to_string_pretty(&file).map_err(|e| Error::io(path.as_ref(), e.into()))?;
        write_text(path, &(text + "\n"))
    }
}

/// Interpolates between the middle two of four points; passes through them.
fn catmull_rom([a, b, c, d]: [DVec3; 4], u: f64) -> DVec3 {
    0.5 * (2.0 * b + u * (c - a + u * (2.0 * a - 5.0 * b + 4.0 * c - d + u * (3.0 * (b - c) + d - a))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(x: f64, angle: f64) -> Camera {
        let rotation = DMat3::from_rotation_y(angle);
        let eye = DVec3::new(x, x * x, -x);
        let (width, height) = (64, 48);
        Camera { width, height, fx: 50.0, fy: 60.0, cx: 32.0, cy: 24.0, rotation, translation: -(rotation * eye) }
    }

    fn path() -> CameraPath {
        let mut path = CameraPath::default();
        [key(0.0, 0.0), key(1.0, 0.4), key(2.0, 1.0), key(3.0, 3.0)].into_iter().for_each(|key| path.push(key));
        path
    }

    #[test]
    fn a_path_goes_through_its_keys_and_is_smooth_there() {
        let path = path();
        assert!(CameraPath::default().is_empty() && !path.is_empty());
        assert_eq!(path.frames(4), path.keys);
        assert_eq!(path.frames(1), path.keys[..1]);
        assert_eq!(CameraPath::default().frames(3), []);
        for t in [1.0, 2.0] {
            let step = 1e-5;
            let eyes = [t - step, t, t + step].map(|t| path.at(t).unwrap().eye());
            let (before, after) = ((eyes[1] - eyes[0]) / step, (eyes[2] - eyes[1]) / step);
            assert!((before - after).length() < 1e-3, "{before} {after}");
        }
        // Between the middle keys of a parabola, the spline is the parabola; rotations have a constant speed.
        let middle = path.at(1.5).unwrap();
        assert!((middle.eye() - DVec3::new(1.5, 2.25, -1.5)).length() < 1e-12);
        assert!((middle.rotation - DMat3::from_rotation_y(0.7)).to_cols_array().iter().all(|v| v.abs() < 1e-12));
        assert!((middle.fx - 50.0).abs() < 1e-9 && middle.width == 64);
        // The shorter rotation, for either sign of the quaternions.
        let mut turn = CameraPath::default();
        [key(0.0, 3.0), key(0.0, -3.0)].into_iter().for_each(|key| turn.push(key));
        let half = turn.at(0.5).unwrap().rotation;
        assert!((half * DVec3::Z).dot(DVec3::NEG_Z) > 0.999);
    }

    #[test]
    fn a_path_is_written_and_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.json");
        let path = path();
        path.write(&file).unwrap();
        let read = CameraPath::read(&file).unwrap();
        assert_eq!((read.len(), read.size()), (4, Some([64, 48])));
        for (a, b) in path.keys.iter().zip(&read.keys) {
            assert!((a.rotation - b.rotation).to_cols_array().iter().all(|v| v.abs() < 1e-14));
            assert!((a.translation - b.translation).length() < 1e-13);
        }
        assert!(CameraPath::default().write(folder.path().join("none.json")).is_err());
    }

    type Change<'a> = &'a dyn Fn(&mut serde_json::Value);

    #[test]
    fn a_wrong_path_is_refused_by_key_and_field() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.json");
        path().write(&file).unwrap();
        let good: serde_json::Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
        let says = |change: Change<'_>| {
            let mut value = good.clone();
            change(&mut value);
            fs::write(&file, value.to_string()).unwrap();
            let error = CameraPath::read(&file).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            error.to_string()
        };
        let wrong: [(Change<'_>, &str); 8] = [
            (&|v| v["width"] = 0.into(), "width is 0, expected 1 to 16384 pixels"),
            (&|v| v["keys"] = serde_json::json!([]), "keys is empty"),
            (&|v| v["keys"][2]["rotation"][0] = 7.into(), "keys[2].rotation: expected a quaternion of length 1"),
            (&|v| v["keys"][1]["focal"][1] = 0.into(), "keys[1].focal: expected numbers above 0"),
            (&|v| v["keys"][1]["eye"][2] = (-1e308).into(), "keys[1].eye: expected numbers of at most 1e30"),
            (&|v| v["keys"][1]["eye"] = serde_json::json!([1, 2]), "expected an array of length 3"),
            (&|v| v["keys"][0]["fov"] = 3.into(), "unknown field `fov`"),
            (&|v| *v = 3.into(), "expected a camera path"),
        ];
        for (change, what) in wrong {
            let text = says(change);
            assert!(text.contains("path.json") && text.contains(what), "{text}");
        }
        assert_eq!(CameraPath::read(folder.path().join("none.json")).unwrap_err().exit_code(), 2);
    }
}

//! A common entry to every file reader that takes bytes, for fuzzing and tests.

use std::io::Cursor;
use std::path::Path;

use super::{CameraPath, SceneFormat, checkpoint, colmap, images, points, scenes, tensors, transforms};
use crate::{Error, Result};

type Check = fn(&[u8], &Path) -> Result<()>;

/// Kinds of files other than scenes, and the reader of each.
const OTHERS: [(&str, Check); 11] = [
    ("ply_points", |bytes, path| points::parse_points(bytes, path, &mut Vec::new()).map(drop)),
    ("colmap_cameras_bin", |bytes, path| cameras(colmap::cameras_binary(bytes, path)?, path)),
    ("colmap_cameras_txt", |bytes, path| cameras(colmap::cameras_text(bytes, path)?, path)),
    ("colmap_images_bin", |bytes, path| poses(colmap::images_binary(Cursor::new(bytes), path)?, path)),
    ("colmap_images_txt", |bytes, path| poses(colmap::images_text(bytes, path)?, path)),
    ("colmap_points_bin", |bytes, path| colmap::points_binary(Cursor::new(bytes), path, &mut Vec::new()).map(drop)),
    ("colmap_points_txt", |bytes, path| colmap::points_text(bytes, path, &mut Vec::new()).map(drop)),
    ("transforms_json", transforms::check),
    ("camera_path", |bytes, path| CameraPath::parse(bytes, path).map(drop)),
    ("image", images::check),
    ("safetensors", |bytes, path| {
        // Few of these files are checkpoints, but the checkpoint reader must also survive any bytes.
        let _ = checkpoint::parse(bytes, None, path);
        tensors::parse_tensors(bytes, path).map(drop)
    }),
];

fn cameras(cameras: colmap::Cameras, path: &Path) -> Result<()> {
    cameras.values().try_for_each(|camera| camera.check()).map_err(|what| Error::input(path, what))
}

fn poses(poses: Vec<colmap::Pose>, path: &Path) -> Result<()> {
    let fault = |pose: &colmap::Pose, what| Error::input(path, format!("image `{}`: its pose {what}", pose.name));
    poses.iter().try_for_each(|pose| pose.rotation().map(drop).map_err(|what| fault(pose, what)))
}

/// Names of the kinds of files that glint reads. A scene format is called by its ending.
pub fn file_kinds() -> impl Iterator<Item = &'static str> {
    let scenes = SceneFormat::ALL.iter().filter(|format| format.read.is_some()).map(|format| format.ending);
    scenes.chain(OTHERS.map(|(name, _)| name))
}

/// Reads `bytes` as a file of a kind from [`file_kinds`], and returns the reader's error. Other files that
/// they name are not opened; `path` is only used in errors.
pub fn check_file(kind: &str, bytes: &[u8], path: &Path) -> Result<()> {
    if let Some(read) = SceneFormat::ALL.iter().find(|format| format.ending == kind).and_then(|format| format.read) {
        return scenes::check(read, bytes, path);
    }
    match OTHERS.iter().find(|(name, _)| *name == kind) {
        Some((_, check)) => check(bytes, path),
        None => Err(Error::Usage(format!("no kind of file is called {kind}"))),
    }
}

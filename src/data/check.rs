//! One entry to every file reader that takes bytes instead of a file.

use std::path::Path;

use super::{CameraPath, Kind, colmap, images, kept, points, scene_file, tensors, transforms};
use crate::{Error, Result};

/// A kind of file that glint reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A 3DGS scene, plain or compressed, see [`super::read_scene`].
    PlyScene,
    /// An SPZ scene of any version.
    Spz,
    /// The archive of an SOG scene.
    Sog,
    /// A `.splat` scene.
    Splat,
    /// glTF, binary or not, with Gaussians.
    Gltf,
    /// A point cloud, see [`super::read_points`].
    PlyPoints,
    /// `cameras.bin` of a COLMAP model.
    ColmapCamerasBin,
    /// `cameras.txt`.
    ColmapCamerasTxt,
    /// `images.bin`.
    ColmapImagesBin,
    /// `images.txt`.
    ColmapImagesTxt,
    /// `points3D.bin`.
    ColmapPointsBin,
    /// `points3D.txt`.
    ColmapPointsTxt,
    /// `transforms.json` of NeRF Synthetic, instant-ngp or nerfstudio.
    TransformsJson,
    /// A camera path, see [`super::CameraPath`].
    CameraPath,
    /// A photo.
    Image,
    /// What an augmentation keeps: [`super::read_tensors`].
    Safetensors,
}

impl FileKind {
    /// All kinds by name.
    pub const ALL: [(&str, FileKind); 16] = [
        ("ply_scene", FileKind::PlyScene),
        ("spz", FileKind::Spz),
        ("sog", FileKind::Sog),
        ("splat", FileKind::Splat),
        ("gltf", FileKind::Gltf),
        ("ply_points", FileKind::PlyPoints),
        ("colmap_cameras_bin", FileKind::ColmapCamerasBin),
        ("colmap_cameras_txt", FileKind::ColmapCamerasTxt),
        ("colmap_images_bin", FileKind::ColmapImagesBin),
        ("colmap_images_txt", FileKind::ColmapImagesTxt),
        ("colmap_points_bin", FileKind::ColmapPointsBin),
        ("colmap_points_txt", FileKind::ColmapPointsTxt),
        ("transforms_json", FileKind::TransformsJson),
        ("camera_path", FileKind::CameraPath),
        ("image", FileKind::Image),
        ("safetensors", FileKind::Safetensors),
    ];

    /// Reads `bytes` as the contents of a file of this kind and says what is wrong with them. Other files that they name are
    /// not looked for; `path` is only named in errors.
    pub fn check(self, bytes: &[u8], path: &Path) -> Result<()> {
        let poses = |poses: Vec<colmap::Pose>| {
            let fault =
                |pose: &colmap::Pose, what| Error::input(path, format!("image `{}`: its pose {what}", pose.name));
            poses.iter().try_for_each(|pose| pose.rotation().map(drop).map_err(|what| fault(pose, what)))
        };
        match self {
            FileKind::PlyScene => scene_file::parse_ply(bytes, path).map(drop),
            FileKind::Spz => scene_file::check(Kind::Spz, bytes, path),
            FileKind::Sog => scene_file::check(Kind::Sog, bytes, path),
            FileKind::Splat => scene_file::check(Kind::Splat, bytes, path),
            FileKind::Gltf => scene_file::check(Kind::Gltf, bytes, path),
            FileKind::PlyPoints => points::parse_points(bytes, path, &mut Vec::new()).map(drop),
            FileKind::ColmapCamerasBin => colmap::cameras_binary(bytes, path).map(drop),
            FileKind::ColmapCamerasTxt => colmap::cameras_text(bytes, path).map(drop),
            FileKind::ColmapImagesBin => poses(colmap::images_binary(bytes, path)?),
            FileKind::ColmapImagesTxt => poses(colmap::images_text(bytes, path)?),
            FileKind::ColmapPointsBin => colmap::points_binary(bytes, path, &mut Vec::new()).map(drop),
            FileKind::ColmapPointsTxt => colmap::points_text(bytes, path, &mut Vec::new()).map(drop),
            FileKind::TransformsJson => transforms::check(bytes, path),
            FileKind::CameraPath => CameraPath::parse(bytes, path).map(drop),
            FileKind::Image => images::check(bytes, path),
            FileKind::Safetensors => {
                // Few of them are checkpoints, and no bytes may make the reader of these fail otherwise than by an error.
                let _ = kept::parse_kept(bytes, path);
                tensors::parse_tensors(bytes, path).map(drop)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_kind_takes_what_is_nothing() {
        for (name, kind) in FileKind::ALL {
            let found = kind.check(b"\xff\0 nothing", Path::new("x"));
            assert!(found.is_err(), "{name}");
        }
    }
}

//! Input and output: PLY scenes, COLMAP and transforms.json datasets, images, tensors, the built-in scene.

#[cfg(feature = "train")]
mod advice;
#[cfg(feature = "train")]
mod assemble;
#[cfg(feature = "train")]
mod atomic;
#[cfg(feature = "train")]
pub mod builtin;
#[cfg(feature = "train")]
mod camera_path;
#[cfg(feature = "formats")]
mod check;
#[cfg(feature = "train")]
pub mod checkpoint;
#[cfg(feature = "train")]
mod colmap;
#[cfg(feature = "train")]
mod dataset;
#[cfg(feature = "train")]
mod folders;
mod formats;
#[cfg(feature = "train")]
mod images;
mod left_out;
#[cfg(feature = "train")]
mod lens;
#[cfg(feature = "train")]
mod listing;
#[cfg(feature = "formats")]
pub mod lod;
#[cfg(feature = "train")]
mod merge;
#[cfg(feature = "train")]
mod names;
#[cfg(feature = "train")]
mod photo;
#[cfg(feature = "train")]
pub mod plan;
pub mod ply;
mod ply_columns;
mod ply_format;
mod ply_variants;
#[cfg(feature = "train")]
mod ply_write;
mod points;
#[cfg(feature = "train")]
mod reduce;
#[cfg(feature = "train")]
mod reduced;
#[cfg(feature = "train")]
mod region;
mod scene_file;
mod scenes;
#[cfg(feature = "train")]
mod sector;
#[cfg(feature = "train")]
mod splits;
pub mod srgb;
#[cfg(feature = "train")]
pub mod tensors;
mod trained_with;
#[cfg(feature = "train")]
mod transforms;
mod validate;
#[cfg(feature = "train")]
mod write;

#[cfg(feature = "train")]
pub use advice::photos_without_poses;
#[cfg(feature = "train")]
pub use atomic::sweep;
#[cfg(feature = "train")]
pub use camera_path::CameraPath;
#[cfg(feature = "formats")]
pub use check::{check_file, file_kinds};
#[cfg(feature = "train")]
pub use dataset::load_photos;
pub use formats::{Kind, SceneFormat};
#[cfg(feature = "cli")]
pub(crate) use left_out::counted;
#[cfg(feature = "train")]
pub use lens::{Distortion, Frame, Lens, Polynomial};
#[cfg(feature = "train")]
pub use merge::{PartSummary, merge};
#[cfg(feature = "train")]
pub use photo::{
    Alpha, DIFFUSE, Dataset, DatasetKind, DatasetOptions, Holdout, Image, ImageFile, Photo, PixelSource, SPECULAR,
    Split,
};
#[cfg(feature = "train")]
pub use ply_write::{band_bytes, gaussian_bytes, scene_bytes};
pub use points::{PointCloud, is_point_cloud, read_points};
#[cfg(feature = "train")]
pub use reduce::Reduce;
#[cfg(feature = "train")]
pub use region::{Focus, NEAR};
pub use scene_file::{SceneFile, is_scene_folder};
pub use scenes::{parse_scene, read_scene, read_scene_file, read_scene_file_leniently, read_scene_leniently};
#[cfg(feature = "train")]
pub use scenes::{write_ply, write_scene, write_scene_as, write_scene_file};
#[cfg(feature = "train")]
pub use tensors::{read_tensors, read_tensors_about, write_tensors, write_tensors_about};
pub use trained_with::{PartOf, TrainedWith};
pub(crate) use validate::lengths;
#[cfg(feature = "c")]
pub(crate) use validate::make_finite;
pub use validate::{Dropped, check_scene};
#[cfg(feature = "train")]
pub use write::{
    to_byte, write_exr_channel, write_exr_rgb, write_png_bytes, write_png_gray, write_png_rgb, write_text,
};

//! What comes in and goes out: PLY scenes, COLMAP and transforms.json datasets, images, tensors, the built-in scene.

mod assemble;
mod atomic;
pub mod builtin;
mod check;
mod colmap;
mod dataset;
mod images;
mod kind;
mod lens;
mod lists;
mod names;
mod places;
pub mod ply;
mod ply_format;
mod reduce;
mod region;
mod sector;
mod shot;
mod sound;
pub mod srgb;
pub mod tensors;
mod transforms;
mod write;

pub use atomic::sweep;
pub use check::FileKind;
pub use dataset::{
    Alpha, DIFFUSE, Dataset, DatasetKind, DatasetOptions, Holdout, ImageFile, Photo, PixelSource, SPECULAR, Split,
    load_photos,
};
pub use images::Image;
pub use kind::Kind;
pub use lens::{Distortion, Frame, Lens, Polynomial};
pub use ply::{PointCloud, read_points, read_scene, read_scene_leniently, scene_bytes, write_augmented, write_scene};
pub use reduce::Reduce;
pub use region::{Focus, NEAR};
pub use sound::Dropped;
pub use tensors::{read_tensors, read_tensors_about, write_tensors, write_tensors_about};
pub use write::{
    to_byte, write_exr_channel, write_exr_rgb, write_png_bytes, write_png_gray, write_png_rgb, write_text,
};

//! What comes in and goes out: PLY scenes, COLMAP and transforms.json datasets, images, tensors, the built-in scene.

mod atomic;
pub mod builtin;
mod check;
mod colmap;
mod dataset;
mod distortion;
mod images;
pub mod ply;
mod ply_format;
mod region;
pub mod tensors;
mod transforms;
mod write;

pub use atomic::sweep;
pub use check::FileKind;
pub use dataset::{Dataset, DatasetKind, DatasetOptions, ImageFile, Photo, PixelSource, Split};
pub use distortion::{Distortion, Lens};
pub use images::Image;
pub use ply::{PointCloud, read_points, read_scene, scene_bytes, write_scene};
pub use region::Focus;
pub use tensors::{read_tensors, write_tensors};
pub use write::{
    to_byte, write_exr_channel, write_exr_rgb, write_png_bytes, write_png_gray, write_png_rgb, write_text,
};

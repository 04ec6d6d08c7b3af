//! What comes in and goes out: PLY scenes, COLMAP and transforms.json datasets, images, tensors.

mod atomic;
pub mod ply;
mod ply_format;

pub use ply::{PointCloud, read_points, read_scene, write_scene};

//! Gaussians, cameras and what is known of a scene on the host.

mod camera;
mod gaussians;

pub use camera::Camera;
pub use gaussians::{Gaussians, Lobes, Scene, Supplement};

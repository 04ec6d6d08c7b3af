//! Gaussians, cameras and what is known of a scene on the host.

mod camera;
pub mod color;
#[cfg(feature = "train")]
mod from_points;
mod gaussians;
pub mod layout;

pub use camera::Camera;
#[cfg(feature = "train")]
pub use from_points::{SH_DC, from_points};
pub use gaussians::{Gaussians, Lobes, Scene, Supplement};

//! A scene on the host: Gaussians, their layout, and cameras.

#[cfg(feature = "train")]
mod axes;
mod camera;
pub mod color;
#[cfg(feature = "train")]
mod from_points;
mod gaussians;
pub mod layout;

#[cfg(feature = "train")]
pub use axes::eigen;
pub use camera::Camera;
#[cfg(feature = "train")]
pub use from_points::{SH_DC, from_points};
pub use gaussians::{Gaussians, Lobes, Scene, Supplement};
/// The version of `glam` whose vectors and matrices are in glint's types.
pub use glam;

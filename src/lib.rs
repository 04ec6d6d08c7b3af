//! Trains, augments and draws 3D Gaussian scenes with Vulkan compute. A scene may have Gaussians whose opacity depends on the viewing
//! direction, for mirrors and highlights.
//!
//! - [`gpu::Context`] is a device: glint's own, or one that another renderer lends.
//! - [`data`] reads and writes scenes; with the feature `train` also datasets.
//! - [`pipelines`] has everything that runs on the device. [`pipelines::frames::Frames`] draws scenes into a renderer's images, in its
//!   command buffers: see `examples/frames.rs` and `docs/embedding.md`.
//! - An [`Error`] names the file or the option, what was found, and what was expected.
//!
//! Data flows one way: `data → scene → pipelines (stages) → report`. `ARCHITECTURE.md` has the map of the source.
//!
//! # Training a scene
//!
//! With the feature `train`, which is on by default; this is `examples/train.rs`.
//!
//! ```no_run
#![doc = include_str!("../examples/train.rs")]
//! ```

#![warn(missing_docs)]

#[cfg(feature = "c")]
pub mod c;
pub mod data;
mod error;
pub mod gpu;
pub mod pipelines;
#[cfg(feature = "train")]
pub mod reference;
#[cfg(feature = "train")]
pub mod report;
pub mod scene;
pub mod stages;
#[cfg(feature = "train")]
pub mod verify;

#[cfg(feature = "cli")]
pub mod cli;

pub use error::{Error, Result};

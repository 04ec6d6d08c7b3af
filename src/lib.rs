//! Augmented radiance fields in Vulkan compute. See `ARCHITECTURE.md`.
//!
//! Data flows one way: `data → scene → pipelines (stages) → report`.

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

//! Augmented radiance fields in Vulkan compute. See `ARCHITECTURE.md`.
//!
//! Data flows one way: `data → scene → pipelines (stages) → report`.

#![warn(missing_docs)]

pub mod data;
mod error;
pub mod gpu;
pub mod pipelines;
pub mod reference;
pub mod report;
pub mod scene;
pub mod stages;
pub mod verify;

#[cfg(feature = "cli")]
pub mod cli;

pub use error::{Error, Result};
